//! Closed forms and hand-computed values; the large tables are in `tests/limit_points.rs`.

//! The outline of some triangles, and whether it winds around a point.

use super::window::Vertex;
use glam::{DVec2, DVec3};

/// An edge of triangles that others do not cancel.
#[derive(Clone, Copy, Debug)]
struct Segment {
    ends: [DVec3; 2],
    /// How often the triangles pass it in this direction more than in the other.
    times: i32,
}

/// What surrounds a target.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    segments: Vec<Segment>,
    min: DVec3,
    max: DVec3,
}

/// Triangles whose outline is wanted.
#[derive(Debug, Default)]
pub(super) struct TriangleSet {
    edges: Vec<([Vertex; 2], i32)>,
    min: DVec3,
    max: DVec3,
}

impl TriangleSet {
    pub fn clear(&mut self) {
        self.edges.clear();
        (self.min, self.max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    }

    /// Adds a triangle, turned over if asked for.
    pub fn add(&mut self, [a, b, c]: [Vertex; 3], is_turned: bool) {
        for p in [a, b, c].map(point) {
            self.min = self.min.min(p);
            self.max = self.max.max(p);
        }
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                let (ends, times) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
                self.edges.push((ends, if is_turned { -times } else { times }));
            }
        }
    }

    /// Largest width along an axis, in lattice steps.
    pub fn extent(&self) -> f64 {
        (self.max - self.min).max_element()
    }

    /// Their outline.
    pub fn outline(&mut self) -> Outline {
        self.edges.sort_unstable();
        let mut segments = Vec::new();
        for group in self.edges.chunk_by(|a, b| a.0 == b.0) {
            let times = group.iter().map(|edge| edge.1).sum();
            if times != 0 {
                segments.push(Segment { ends: group[0].0.map(point), times });
            }
        }
        Outline { segments, min: self.min, max: self.max }
    }
}

pub(super) fn point(v: Vertex) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

impl Outline {
    /// Whether the outline, seen along the unit vector `direction`, winds around `point` and keeps `margin` away from
    /// it.
    pub fn encloses(&self, point: DVec3, direction: DVec3, margin: f64) -> bool {
        let (right, up) = direction.any_orthonormal_pair();
        let seen = |p: DVec3| DVec2::new((p - point).dot(right), (p - point).dot(up));
        let mut winding = 0;
        for segment in &self.segments {
            let [a, b] = segment.ends.map(seen);
            if distance_squared(a, b) < margin * margin {
                return false;
            }
            winding += segment.times * crossing(a, b);
        }
        winding != 0
    }

    /// The farthest that a triangle reaches beyond `point` along `direction`.
    pub fn depth(&self, point: DVec3, direction: DVec3) -> f64 {
        ((self.min - point) * direction).max((self.max - point) * direction).element_sum()
    }
}

/// 1 if the segment crosses the positive x axis upwards, -1 downwards, 0 if it does not.
fn crossing(a: DVec2, b: DVec2) -> i32 {
    if (a.y < 0.0) == (b.y < 0.0) || (a.perp_dot(b) > 0.0) != (a.y < 0.0) {
        0
    } else if a.y < 0.0 {
        1
    } else {
        -1
    }
}

/// Squared distance of a segment from the origin.
fn distance_squared(a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let t = (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    // A segment seen end-on has no length: `clamp` keeps the NaN, and then its ends are as near as it gets.
    if t.is_nan() { a.length_squared() } else { (a + t * along).length_squared() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around_origin() -> Outline {
        let mut set = TriangleSet::default();
        set.clear();
        let corners = [[10, 0, 0], [0, 10, 0], [-10, 0, 0], [0, -10, 0]];
        (0..4).for_each(|k| set.add([[0, 0, 1], corners[k], corners[(k + 1) % 4]], false));
        set.outline()
    }

    #[test]
    fn a_fan_of_triangles_encloses_its_centre_from_both_sides() {
        let outline = around_origin();
        assert_eq!(outline.segments.len(), 4);
        let top = DVec3::Z;
        assert!(outline.encloses(top, DVec3::Z, 7.0) && outline.encloses(top, DVec3::NEG_Z, 7.0));
        assert!(!outline.encloses(top, DVec3::Z, 7.2), "the outline comes within 10 / sqrt 2");
        assert!(!outline.encloses(top, DVec3::X, 0.1), "seen edge-on");
        assert!((outline.depth(top, DVec3::NEG_Z) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_fan_with_a_gap_does_not() {
        let mut set = TriangleSet::default();
        set.clear();
        set.add([[0, 0, 0], [10, 0, 0], [0, 10, 0]], false);
        set.add([[0, 0, 0], [0, 10, 0], [-10, 0, 0]], false);
        assert!(!set.outline().encloses(DVec3::ZERO, DVec3::Z, 0.5));
    }

    #[test]
    fn a_triangle_turned_over_cancels_what_it_shares() {
        let mut set = TriangleSet::default();
        set.clear();
        set.add([[0, 0, 0], [10, 0, 0], [0, 10, 0]], false);
        set.add([[0, 0, 0], [10, 0, 0], [0, -10, 0]], true);
        assert!(set.outline().encloses(DVec3::new(5.0, 0.0, 0.0), DVec3::Z, 0.5));
    }
}

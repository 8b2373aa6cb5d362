//! The lazytess command.

fn main() {}

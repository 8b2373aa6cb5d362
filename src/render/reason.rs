//! Why a pixel was traced, or why not.

use serde::{Serialize, Serializer, ser::SerializeMap};
use std::ops::AddAssign;

/// What decided how a pixel got its colour. The number is what `--aov reason` stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Reason {
    /// Traced: groups are off, or do not pay here, or the integrator is not one that can be interpolated.
    #[default]
    Every,
    /// Traced: a corner of a group.
    Corner,
    /// Traced: checks an interpolation, which held.
    Probe,
    /// Traced: near the border of a mesh, or of a mesh against another.
    Silhouette,
    /// Traced: something that no ray of the group has met may stand in front.
    Hidden,
    /// Traced: near the edge of a shadow.
    Shadow,
    /// Traced: what is reflected or refracted changes nearby.
    Reflection,
    /// Traced: the normal turns too far, as at a crease.
    Crease,
    /// Traced: a probe contradicted the interpolation by more than the tolerance.
    Contradiction,
    /// Traced: beside an edge, which may go on.
    Neighbour,
    /// Not traced: from the group's corners.
    Interpolated,
    /// Not traced: no patch reaches the pixel.
    Background,
    /// Traced: the edge of a pattern is nearer than the group's positions are sure.
    Pattern,
}

impl Reason {
    /// Every reason with its name in statistics, by number.
    pub const ALL: [(&'static str, Self); 13] = [
        ("every", Self::Every),
        ("corner", Self::Corner),
        ("probe", Self::Probe),
        ("silhouette", Self::Silhouette),
        ("hidden", Self::Hidden),
        ("shadow", Self::Shadow),
        ("reflection", Self::Reflection),
        ("crease", Self::Crease),
        ("contradiction", Self::Contradiction),
        ("neighbour", Self::Neighbour),
        ("interpolated", Self::Interpolated),
        ("background", Self::Background),
        ("pattern", Self::Pattern),
    ];

    /// Whether rays were traced for the pixel.
    pub fn is_traced(self) -> bool {
        !matches!(self, Self::Interpolated | Self::Background)
    }

    /// Whether an edge was seen, which may go on in the neighbouring groups.
    pub(super) fn is_edge(self) -> bool {
        self.is_edge_of_light() || matches!(self, Self::Silhouette | Self::Crease)
    }

    /// Whether that edge is one that footprints know nothing of.
    pub(super) fn is_edge_of_light(self) -> bool {
        matches!(self, Self::Shadow | Self::Reflection | Self::Contradiction)
    }
}

/// Number of pixels by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelCounts([u64; Reason::ALL.len()]);

impl PixelCounts {
    /// Counts `n` pixels.
    pub fn add(&mut self, reason: Reason, n: u64) {
        self.0[reason as usize] += n;
    }

    /// Of the pixels that were counted, `n` have another reason now.
    pub fn change(&mut self, from: Reason, to: Reason, n: u64) {
        self.0[from as usize] -= n;
        self.0[to as usize] += n;
    }

    /// Pixels with this reason.
    pub fn of(&self, reason: Reason) -> u64 {
        self.0[reason as usize]
    }

    /// Pixels that rays were traced for.
    pub fn traced(&self) -> u64 {
        Reason::ALL.iter().filter(|(_, reason)| reason.is_traced()).map(|&(_, reason)| self.of(reason)).sum()
    }
}

impl AddAssign for PixelCounts {
    fn add_assign(&mut self, other: Self) {
        self.0.iter_mut().zip(other.0).for_each(|(a, b)| *a += b);
    }
}

impl Serialize for PixelCounts {
    /// A key for each reason.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(Reason::ALL.len()))?;
        for (name, reason) in Reason::ALL {
            map.serialize_entry(name, &self.of(reason))?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_listed_by_number() {
        assert!(Reason::ALL.iter().enumerate().all(|(i, (_, reason))| *reason as usize == i));
    }

    #[test]
    fn only_traced_pixels_count_as_traced() {
        let mut counts = PixelCounts::default();
        Reason::ALL.iter().for_each(|&(_, reason)| counts.add(reason, 1));
        assert_eq!(counts.traced(), 11);
    }
}

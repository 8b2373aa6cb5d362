//! How high everything stands that is seen from a patch: so that rays that leave it above that meet nothing at all, and
//! need no walk.
//!
//! Nine of ten rays that leave a body of a scene meet nothing (occlusion and diffuse rays of the benchmark's meshes). A
//! **skyline** bounds, for each of 4 x 4 **parts** of a patch and each of eight
//! **octants** of directions around its normal, the **elevation** of all that such a ray may meet (horizon maps, Max
//! 1988, know as much of points).
//!
//! # The frame
//! Vectors m_u, m_v and n = m_u x m_v, or its opposite, which points to the side that is left. w has the coordinates
//! x = m_u·w, y = m_v·w, and its height z = n·w. Octants are told apart by the signs of x and y and by which of them is
//! greater in magnitude: in an octant, w goes **ahead** by max(|x|, |y|), which is linear there. Elevation is height
//! for what one goes ahead.
//!
//! # What is near
//! Blocks of cells of some patches, the **sheet**: of the own one and of others that share corners with it, those all
//! of whose triangles are seen from n, their normals turned less than 87 degrees. What is around the blocks of a patch
//! are lines of edges, run through counter-clockwise. Edges that are run through as often from one end as from the
//! other cancel: there the surface goes on. The others are open. Take a rectangle D of x and y that no open edge
//! enters, and around whose middle they wind once: above each point of D, but for those of edges, is exactly one
//! triangle, since all triangles face n, so that there are as many as their border winds (its degree), and that is the
//! same everywhere in D. Where two of them meet within D, the edge is the same for both, or it would be open: so the
//! sheet is the graph of a function over D.
//!
//! Let a ray start over D, above the sheet or on it, and meet a point t of the sheet over D. Between, above a straight
//! line of D, runs a way on the sheet: go along it from where the ray starts, from triangle to triangle; it ends in t,
//! as nothing else is above t's place. So the ray is not steeper than the steepest triangle on the way, seen along it.
//! Triangles on the way are of blocks of the sheet that, from some point of the part, lie ahead in the ray's octant;
//! the steepest of them, in the steepest direction of the octant, is the elevation of what is near.
//!
//! # What is far
//! All else is put into boxes of x, y and z: what is near but not inside of D, and blocks that turn away. From a box
//! around the part to another the elevation in an octant is the greatest height over the least that one goes ahead, of
//! the differences of their points that lie in that octant.
//!
//! # Where the ray starts
//! On a triangle of the part, or above it along the triangle's normal N, as far as the skyline's **lift**, which D and
//! the part's box allow for. It is above the sheet there if N itself is higher than what is near in N's octant: where
//! that does not hold, nobody leaves.
//!
//! # Parts
//! A patch that bends sees little along one frame: what rises to one side of it is higher than most of the sky. So a
//! part from which many rays leave that do not clear the patch's skyline has a [`PartSkyline`], of its four quarters,
//! by the same argument in a frame of its own and with smaller blocks.

mod border;
mod measure;
mod octants;
mod outline;
mod sheet;
mod view;

pub use sheet::{SeenFrom, SkylineSheet};
pub use view::SkylineView;

use super::frame::{Course, MARGIN_IN_HEIGHT, PACKED, PARTS, PackedFrame};
use crate::math::simd::Kernel;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Units of elevation in that of height over way: elevations up to 4 fit a byte.
const UNITS: f32 = 0.5;

/// The elevation of what nobody clears.
const NEVER: i8 = i8::MAX;

/// Lengths of directions whose products with the frame are neither too small nor too large for f32.
const ORDINARY: Range<f32> = 1e-20..1e20;

/// How high everything stands that is seen from each part of a patch, on one side.
#[derive(Clone, Copy, PartialEq, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Skyline {
    frame: PackedFrame,
    /// How far above the patch rays may start, in lattice steps.
    lift: f32,
    unused: u32,
    /// By 4 times the part along v and the part along u, then by octant.
    elevations: [[i8; 8]; PARTS * PARTS],
}

impl Skyline {
    /// Parts of a patch.
    pub const N_PARTS: u32 = (PARTS * PARTS) as u32;

    /// Words of a skyline.
    pub const WORDS: usize = size_of::<Self>() / size_of::<u64>();

    /// Of what may be met anywhere.
    pub const NONE: Self =
        Self { frame: PackedFrame::NONE, lift: 0.0, unused: 0, elevations: [[NEVER; 8]; PARTS * PARTS] };

    /// In words.
    pub fn to_words(self) -> [u64; Self::WORDS] {
        bytemuck::cast(self)
    }

    /// Roughly which share of diffuse rays from all over the patch clear it, in percent.
    pub fn openness(&self) -> u32 {
        openness(self.elevations.as_flattened())
    }

    /// The same from one part.
    pub fn openness_of_part(&self, part: u32) -> u32 {
        openness(&self.elevations[part as usize])
    }

    /// From [`to_words`](Self::to_words).
    pub fn from_words(words: [u64; Self::WORDS]) -> Self {
        bytemuck::cast(words)
    }

    /// The part in which a cell is: 4 times the one along v and the one along u.
    pub fn part(&self, cell: [u16; 2]) -> u32 {
        Self::part_of(bytemuck::cast(self.frame), cell)
    }

    /// Whether a ray in that direction, which starts on a triangle of cell `cell` or up to `lift` lattice steps above
    /// it, is so high that it meets nothing. `word` reads one of the skyline's words: few of them are.
    #[inline(always)]
    pub fn is_cleared_by<K: Kernel>(
        k: K,
        direction: K::D,
        cell: [u16; 2],
        lift: f32,
        word: impl Fn(usize) -> u64,
    ) -> bool {
        let part = Self::part_of(word(0), cell) as usize;
        are_cleared_by(k, bytemuck::cast(word(0)), word(2 + part), word(1), direction, lift)
    }

    /// See [`part`](Self::part), of a skyline whose first word is this.
    #[inline(always)]
    pub fn part_of(first_word: u64, cell: [u16; 2]) -> u32 {
        let frame: PackedFrame = bytemuck::cast(first_word);
        let [u, v] = frame.part(cell.map(u32::from));
        PARTS as u32 * v + u
    }
}

/// A skyline of one part of a patch, of its quarters, as seen along the part's own axes: patches that bend see more of
/// themselves than of the sky.
#[derive(Clone, Copy, PartialEq, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PartSkyline {
    frame: PackedFrame,
    /// See [`Skyline`].
    lift: f32,
    unused: u32,
    /// By 2 times the quarter along v and the quarter along u, then by octant.
    elevations: [[i8; 8]; 4],
}

impl PartSkyline {
    /// Words of a part's skyline.
    pub const WORDS: usize = size_of::<Self>() / size_of::<u64>();

    /// In words.
    pub fn to_words(self) -> [u64; Self::WORDS] {
        bytemuck::cast(self)
    }

    /// See [`Skyline::openness`].
    pub fn openness(&self) -> u32 {
        openness(self.elevations.as_flattened())
    }

    /// See [`Skyline::is_cleared_by`]; the cell is one of the part.
    #[inline(always)]
    pub fn is_cleared_by<K: Kernel>(
        k: K,
        direction: K::D,
        cell: [u16; 2],
        lift: f32,
        word: impl Fn(usize) -> u64,
    ) -> bool {
        let frame: PackedFrame = bytemuck::cast(word(0));
        let [u, v] = frame.half_part(cell.map(u32::from));
        are_cleared_by(k, frame, word(2 + 2 * (v as usize % 2) + u as usize % 2), word(1), direction, lift)
    }
}

/// Roughly which share of diffuse rays clears such elevations, in percent: those that are higher than an angle above
/// the horizontal are the square of its cosine of all, whichever octant they are in.
fn openness(elevations: &[i8]) -> u32 {
    let above = |elevation: i8| {
        let slope = f32::from(elevation.max(0)) / UNITS / PACKED;
        if elevation < NEVER { 1.0 / (1.0 + slope * slope) } else { 0.0 }
    };
    (100.0 * elevations.iter().map(|elevation| above(*elevation)).sum::<f32>() / elevations.len() as f32) as u32
}

/// Whether a ray is higher than these elevations; the first half of a word is the most that it may be lifted.
#[inline(always)]
fn are_cleared_by<K: Kernel>(
    k: K,
    frame: PackedFrame,
    elevations: u64,
    lifts: u64,
    direction: K::D,
    lift: f32,
) -> bool {
    let [most_lift, _unused]: [f32; 2] = bytemuck::cast(lifts);
    let elevations: [i8; 8] = bytemuck::cast(elevations);
    let length = k.greatest_of_three(k.abs4(direction)) as f32;
    let Course { ways: [x, y], shrinks, height } = frame.course(k, k.floats_of(direction));
    let octant = octants::octant([x, y], shrinks);
    let elevation = (u64::from_le_bytes(elevations.map(i8::cast_unsigned)) >> (8 * octant)) as i8;
    let ahead = if x < y { y } else { x };
    elevation < NEVER
        && height > f32::from(elevation) / UNITS * ahead + MARGIN_IN_HEIGHT * length
        && ORDINARY.contains(&length)
        && lift <= most_lift
}

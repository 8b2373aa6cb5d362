//! A city by the sea: towers with setbacks, ledges, twists and domes, a few hundred of them in a grid of streets.
//!
//! Lengths are in units of about ten metres. Each part of the city is a mesh of its own, so that it can have its own
//! material; all share one coordinate system.

use super::NamedShape;
use super::model::Model;
use super::noise::Random;
use super::sweep::lathe;
use crate::mesh::{Assembly, BoundaryRule, ControlMesh};
use glam::{DAffine3, DVec2, DVec3};

/// Blocks along a side of the city.
const N_BLOCKS: i32 = 13;
/// Edge of a block with the street beside it.
const PITCH: f64 = 5.0;
/// Half edge of a block without streets.
const HALF_BLOCK: f64 = 2.0;
/// Height of the pavement above the street.
const PAVEMENT: f64 = 0.06;

/// Centre of the bay, as (x, z).
const BAY: DVec2 = DVec2::new(22.0, 24.0);
/// Where its water ends.
const BAY_RADIUS: f64 = 10.5;

/// Every mesh of the scene by the stem of its file name.
pub(super) fn meshes() -> Vec<NamedShape> {
    let blocks: Vec<_> = (0..N_BLOCKS * N_BLOCKS).map(Block::new).filter(Block::on_land).collect();
    let buildings: Vec<_> = blocks.iter().flat_map(Block::buildings).collect();
    let made_of = |facade: Facade| {
        let parts = buildings.iter().filter(|b| b.facade == facade).map(|b| (b.mesh(), b.world_from_object()));
        assembled(parts)
    };
    vec![
        ("city-stone", made_of(Facade::Stone)),
        ("city-brick", made_of(Facade::Brick)),
        ("city-glass", made_of(Facade::Glass)),
        ("city-blocks", assembled(blocks.iter().map(|b| (slab(), b.world_from_slab())))),
        ("city-trees", assembled(blocks.iter().flat_map(Block::trees))),
        ("city-shore", shore()),
        ("city-sea", sea()),
    ]
}

fn assembled(parts: impl Iterator<Item = (ControlMesh, DAffine3)>) -> ControlMesh {
    let mut city = ControlMesh::default();
    let mut assembly = Assembly::new(&mut city);
    for (part, world_from_part) in parts {
        assembly.add(&part, world_from_part).expect("a mesh in memory takes every part");
    }
    city
}

/// The ground between four streets.
struct Block {
    number: u64,
    center: DVec2,
}

impl Block {
    fn new(k: i32) -> Self {
        let along = |i: i32| PITCH * f64::from(i - N_BLOCKS / 2);
        Self { number: k as u64, center: DVec2::new(along(k % N_BLOCKS), along(k / N_BLOCKS)) }
    }

    /// The city is round, but for a bay.
    fn on_land(&self) -> bool {
        self.center.length() < 34.0 && self.center.distance(BAY) > BAY_RADIUS + 2.5
    }

    fn random(&self, what: u64) -> Random {
        Random::new(0xc171 + what, self.number)
    }

    fn park(&self) -> bool {
        self.random(0).chance(0.12)
    }

    fn world_from_slab(&self) -> DAffine3 {
        DAffine3::from_translation(DVec3::new(self.center.x, 0.0, self.center.y))
    }

    /// One tower on the whole block, or four on its quarters.
    fn buildings(&self) -> Vec<Building> {
        if self.park() {
            return Vec::new();
        }
        let mut random = self.random(1);
        let lots = if random.chance(0.35) {
            vec![(DVec2::ZERO, 0.85 * HALF_BLOCK)]
        } else {
            let quarter = 0.5 * HALF_BLOCK;
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|corner| (quarter * DVec2::from_array(corner), 0.8 * quarter))
                .to_vec()
        };
        lots.into_iter().map(|(offset, half)| Building::new(self.center + offset, half, &mut random)).collect()
    }

    /// Trees in parks: a ball on a stem.
    fn trees(&self) -> Vec<(ControlMesh, DAffine3)> {
        if !self.park() {
            return Vec::new();
        }
        let mut random = self.random(2);
        let tree = |_| {
            let mut spot = || random.within(-0.9, 0.9) * HALF_BLOCK;
            let position = DVec3::new(self.center.x + spot(), PAVEMENT, self.center.y + spot());
            let size = DVec3::new(1.0, random.within(0.9, 1.5), 1.0) * random.within(0.25, 0.5);
            (tree(), DAffine3::from_translation(position) * DAffine3::from_scale(size))
        };
        (0..18).map(tree).collect()
    }
}

/// The island under the city: one polygon for the streets, with the bay cut out, and a quay around it.
fn shore() -> ControlMesh {
    const N: u32 = 64;
    let mut shore = Model::from_mesh(&super::prism(N));
    for p in &mut shore.positions {
        let radius = shore_radius(DVec2::new(p.x, p.z).normalize());
        *p = DVec3::new(radius * p.x, 0.5 * (p.y - 1.0), radius * p.z);
    }
    shore.crease_by_angle(60.0, f32::INFINITY);
    shore.into_mesh()
}

/// Distance from the origin to the water in a direction.
fn shore_radius(direction: DVec2) -> f64 {
    const ISLAND: f64 = 37.0;
    let (along, across) = (direction.dot(BAY), direction.perp_dot(BAY));
    let half_chord = BAY_RADIUS * BAY_RADIUS - across * across;
    if along > 0.0 && half_chord > 0.0 { ISLAND.min(along - half_chord.sqrt()) } else { ISLAND }
}

/// A square of water below the streets, up to the horizon.
fn sea() -> ControlMesh {
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
    let positions = corners.map(|[x, z]| DVec3::new(20_000.0 * x, -0.4, 20_000.0 * z)).to_vec();
    let mut sea = super::polygons(positions, [[0, 1, 2, 3]]);
    sea.boundary = BoundaryRule::EdgeAndCorner;
    sea
}

/// A rounded slab of pavement.
fn slab() -> ControlMesh {
    let mut slab = Model::from_mesh(&super::cube());
    slab.transform(DAffine3::from_scale(DVec3::new(HALF_BLOCK, PAVEMENT, HALF_BLOCK)));
    for [a, b] in [[2, 3], [3, 7], [7, 6], [6, 2], [0, 1], [1, 5], [5, 4], [4, 0]] {
        slab.crease(a, b, 6.0);
    }
    (0..8).filter(|v| v & 2 == 0).for_each(|v| slab.crease(v, v + 2, 3.0));
    slab.into_mesh()
}

fn tree() -> ControlMesh {
    let profile = [(0.12, 0.0, 0.0), (0.1, 0.45, 0.0), (0.8, 0.55, 0.0), (0.9, 1.2, 0.0), (0.3, 1.6, 0.0)];
    lathe(&profile, 5).into_mesh()
}

/// How a tower goes up.
#[derive(Clone, Copy)]
enum Style {
    /// Walls under a hipped roof.
    House,
    /// Tiers that step back, and a spire.
    Setback,
    /// Storeys between ledges.
    Ledges,
    /// A square shaft that turns as it rises.
    Twisted,
    /// A round shaft under a dome.
    Dome,
}

/// What a building looks like from the street; each is a mesh, so that it can have a material.
#[derive(Clone, Copy, PartialEq)]
enum Facade {
    Stone,
    Brick,
    Glass,
}

struct Building {
    center: DVec2,
    half: DVec2,
    height: f64,
    style: Style,
    facade: Facade,
}

impl Building {
    fn new(center: DVec2, half: f64, random: &mut Random) -> Self {
        // Towers stand downtown, about the origin; houses further out.
        let downtown = (1.0 - center.length() / 30.0).max(0.0);
        let height = (1.1 + 15.0 * downtown.powi(2) * random.within(0.3, 1.3)) * half.sqrt() * random.within(0.7, 1.3);
        let slim = |random: &mut Random| half * random.within(0.75, 1.0);
        let style = match random.below(10) {
            0 | 1 if height < 4.0 => Style::Dome,
            _ if height < 2.0 => Style::House,
            0..5 => Style::Setback,
            5..8 => Style::Ledges,
            _ => Style::Twisted,
        };
        let (glass, brick) = match style {
            Style::House => (0.0, 0.75),
            Style::Twisted => (1.0, 0.0),
            Style::Ledges => (0.4, 0.3),
            Style::Dome => (0.1, 0.0),
            Style::Setback => (0.15, 0.35),
        };
        let facade = match random.unit() {
            x if x < glass => Facade::Glass,
            x if x < glass + brick => Facade::Brick,
            _ => Facade::Stone,
        };
        Self { center, half: DVec2::new(slim(random), slim(random)), height, style, facade }
    }

    fn world_from_object(&self) -> DAffine3 {
        DAffine3::from_translation(DVec3::new(self.center.x, 0.9 * PAVEMENT, self.center.y))
    }

    fn mesh(&self) -> ControlMesh {
        let (profile, n) = match self.style {
            Style::House => (house_profile(self.height), 4),
            Style::Setback => (setback_profile(self.height), 4),
            Style::Ledges => (ledge_profile(self.height), 4),
            Style::Twisted => (shaft_profile(self.height), 4),
            Style::Dome => (dome_profile(self.height), 8),
        };
        let mut tower = lathe(&profile, n);
        // A ring of four has its corners at distance 1 on the axes; turned, they lie at half a diagonal.
        let (turn, widen) = if n == 4 { (std::f64::consts::FRAC_PI_4, std::f64::consts::SQRT_2) } else { (0.0, 1.0) };
        let size = DVec3::new(widen * self.half.x, 1.0, widen * self.half.y);
        tower.transform(DAffine3::from_scale(size) * DAffine3::from_rotation_y(turn));
        match self.style {
            Style::Twisted => self.twist(&mut tower),
            Style::Dome => {}
            Style::House | Style::Setback | Style::Ledges => tower.crease_by_angle(40.0, 3.0),
        }
        tower.into_mesh()
    }

    fn twist(&self, tower: &mut Model) {
        tower.crease_by_angle(40.0, 2.0);
        for p in &mut tower.positions {
            *p = DAffine3::from_rotation_y(1.6 * p.y / self.height).transform_point3(*p);
        }
    }
}

fn house_profile(h: f64) -> Vec<(f64, f64, f32)> {
    [(0.9, 0.0), (0.9, 0.55), (1.05, 0.5), (1.05, 0.54), (0.0, 1.0)].map(|(r, y)| (r, y * h, 0.0)).to_vec()
}

fn setback_profile(h: f64) -> Vec<(f64, f64, f32)> {
    let tiers = [(1.0, 0.0), (1.0, 0.45), (0.8, 0.45), (0.8, 0.7), (0.55, 0.7), (0.55, 0.86), (0.3, 0.88), (0.3, 0.94)];
    let spire = [(0.05, 0.96), (0.03, 1.12)];
    tiers.into_iter().chain(spire).map(|(r, y)| (r, y * h, 0.0)).collect()
}

fn ledge_profile(h: f64) -> Vec<(f64, f64, f32)> {
    let n_storeys = (h / 1.1).clamp(2.0, 5.0) as u32;
    let storey = |k: u32| {
        let (low, high) = (f64::from(k) / f64::from(n_storeys), f64::from(k + 1) / f64::from(n_storeys));
        let ledge = high - 0.14 / f64::from(n_storeys);
        [(0.9, low), (0.9, ledge), (1.0, ledge), (1.0, high)].map(|(r, y)| (r, y * h, 0.0))
    };
    let roof = [(0.85, 1.0), (0.85, 0.98)].map(|(r, y)| (r, y * h, 0.0));
    (0..n_storeys).flat_map(storey).chain(roof).collect()
}

fn shaft_profile(h: f64) -> Vec<(f64, f64, f32)> {
    let ring = |k: i32| (0.95 - 0.03 * f64::from(k), 0.125 * f64::from(k) * h, 0.0);
    (0..9).map(ring).chain([(0.55, 0.985 * h, 0.0)]).collect()
}

fn dome_profile(h: f64) -> Vec<(f64, f64, f32)> {
    let drum = [(1.0, 0.0, 3.0), (1.0, 0.5, 3.0), (1.08, 0.52, 3.0), (1.08, 0.56, 3.0), (0.95, 0.57, 2.0)];
    let dome = [(0.95, 0.72, 0.0), (0.7, 0.92, 0.0), (0.2, 1.0, 1.0), (0.1, 1.02, 2.0), (0.02, 1.15, 2.0)];
    drum.into_iter().chain(dome).map(|(r, y, s)| (r, y * h, s)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Edges, signed_volume};
    use super::*;

    #[test]
    fn city_parts_are_closed_and_look_outwards() {
        for (name, part) in meshes().into_iter().filter(|(name, _)| *name != "city-sea") {
            part.validate().unwrap();
            assert!(Edges::of(&part).closed(), "{name}");
            assert!(signed_volume(&part) > 1.0, "{name}");
        }
    }

    #[test]
    fn full_tessellation_at_rate_80_exceeds_a_hundred_million_triangles() {
        let n_patches: u64 = meshes()
            .iter()
            .flat_map(|(_, part)| part.face_sizes.iter())
            .map(|&n| if n == 4 { 4 } else { u64::from(n) })
            .sum();
        // A face of n corners is n quarter patches of half the rate; counted in quarters.
        let triangles = n_patches * 2 * 40 * 40;
        assert!(triangles > 100_000_000, "{triangles}");
    }
}

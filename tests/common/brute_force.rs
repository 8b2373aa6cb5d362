//! The slow tracer: every patch tessellated beforehand, every triangle tested in f64.
//!
//! Rays and triangles are compared in a mesh's lattice space, where rounding errors are known in steps: the lazy tracer
//! works there in f32, with coordinates below 2^25.

use glam::{DAffine3, DVec3, IVec3};
use lazytess::ids::{MeshId, PatchId};
use lazytess::math::{Hit, PrimitiveRef, Ray};
use lazytess::scene::tessellate::{PatchGrid, triangles};
use lazytess::scene::world::{World, WorldMesh};
use lazytess::subdiv::PatchRates;
use lazytess::subdiv::dice::LATTICE_SHIFT;

/// How far f32 arithmetic may shift a ray sideways, in steps.
const SLACK: f64 = 96.0;

/// All triangles of a world.
pub struct BruteForce<'w> {
    world: &'w World,
    meshes: Vec<Vec<Patch>>,
}

struct Patch {
    id: PatchId,
    rates: PatchRates,
    /// Both halves of cell (0,0), then of (1,0), and so on.
    triangles: Vec<Triangle>,
}

#[derive(Clone, Copy)]
struct Triangle([DVec3; 3]);

/// A ray in the lattice of one mesh.
#[derive(Clone, Copy)]
struct LatticeRay {
    origin: DVec3,
    direction: DVec3,
}

/// A triangle as a ray sees it: across the ray, and along it.
struct View {
    /// Steps from the ray to the triangle's border, positive inside.
    inside: f64,
    /// Where the ray meets the triangle's plane.
    t: f64,
    /// By how many steps along the ray the place of a hit may be wrong.
    uncertainty: f64,
}

impl<'w> BruteForce<'w> {
    /// Tessellates all.
    pub fn new(world: &'w World) -> Self {
        Self { world, meshes: world.meshes().iter().map(tessellate).collect() }
    }

    /// Number of triangles.
    pub fn n_triangles(&self) -> usize {
        self.meshes.iter().flatten().map(|patch| patch.triangles.len()).sum()
    }

    /// What is wrong with the lazy tracer's answer to `ray`, if anything.
    pub fn objection(&self, ray: &Ray, answer: Option<&Hit>) -> Option<String> {
        let wrong = answer.and_then(|hit| self.check_hit(ray, hit));
        wrong.or_else(|| self.check_nothing_nearer(ray, answer.map_or(ray.t_max, |hit| hit.t)))
    }

    /// The triangle named is there, at the place named.
    fn check_hit(&self, ray: &Ray, hit: &Hit) -> Option<String> {
        let mesh = self.world.mesh(hit.primitive.mesh);
        let patch = self.meshes[hit.primitive.mesh.idx()].iter().find(|p| p.id == hit.primitive.patch);
        let patch = patch.expect("a patch that is hit has a surface");
        let [i, j] = hit.primitive.cell.map(u32::from);
        let cell = j * patch.rates.n_u + i;
        if mesh.surface().edited().hide_cell(patch.id, &patch.rates, cell) {
            return Some(format!("cell ({i}, {j}) of patch {} lies in a hole", patch.id));
        }
        let triangle = patch.triangles[2 * cell as usize + usize::from(hit.primitive.half)];
        let [a, b] = weights(&patch.rates, hit);
        if a.min(b).min(1.0 - a - b) < -1e-4 {
            return Some(format!("u, v = {}, {} lie outside the triangle: weights {a}, {b}", hit.u, hit.v));
        }
        let seen = LatticeRay::new(mesh, ray);
        let named = triangle.point(a, b);
        let distance = named.distance(seen.origin + f64::from(hit.t) * seen.direction);
        let allowed = triangle.seen_by(&seen).uncertainty + seen.rounding(hit.t.into());
        if distance > allowed {
            return Some(format!("the hit is {distance} steps from the triangle it names, {allowed} are allowed"));
        }
        let (face, sub) = mesh.surface().face_of(patch.id);
        let normal = triangle.normal() * mesh.surface().lattice().step.powi(2);
        (hit.face != face || hit.sub != sub || hit.normal_in_object != normal).then(|| {
            format!("face {}.{} and normal {} are not those of the triangle", hit.face, hit.sub, hit.normal_in_object)
        })
    }

    /// No triangle is hit beyond doubt before `t`.
    fn check_nothing_nearer(&self, ray: &Ray, t: f32) -> Option<String> {
        self.world.meshes().iter().enumerate().find_map(|(id, mesh)| {
            let (id, seen) = (MeshId::from(id), LatticeRay::new(mesh, ray));
            self.meshes[id.idx()].iter().find_map(|patch| {
                let k = patch.triangles.iter().enumerate().position(|(k, triangle)| {
                    let view = triangle.seen_by(&seen);
                    let doubt = (view.uncertainty + seen.rounding(view.t)) / seen.direction.length();
                    let nearer = view.t > doubt && view.t + doubt < f64::from(t);
                    let is_there = || !mesh.surface().edited().hide_cell(patch.id, &patch.rates, k as u32 / 2);
                    view.inside > SLACK && nearer && ray.from != Some(name(id, patch, k)) && is_there()
                })?;
                Some(format!("mesh {id}, patch {}, triangle {k} is before t = {t} and was not hit", patch.id))
            })
        })
    }
}

fn tessellate(mesh: &WorldMesh) -> Vec<Patch> {
    let mut grid = PatchGrid::default();
    let patches = mesh.surface().visible_patches().map(|id| {
        let rates = mesh.patch_rates(id);
        grid.dice(mesh, id, &rates);
        let vertex = |i: usize| IVec3::from_array(grid.vertices[i]).as_dvec3();
        Patch { id, rates, triangles: triangles(&rates).map(|t| Triangle(t.map(vertex))).collect() }
    });
    patches.collect()
}

fn name(mesh: MeshId, patch: &Patch, triangle: usize) -> PrimitiveRef {
    let (cell, n_u) = (triangle as u32 / 2, patch.rates.n_u);
    let cell = [cell % n_u, cell / n_u].map(|c| c as u16);
    PrimitiveRef { mesh, patch: patch.id, cell, half: (triangle % 2) as u8 }
}

/// Weights of the triangle's second and third vertex at the hit's u and v.
fn weights(rates: &PatchRates, hit: &Hit) -> [f64; 2] {
    let [i, j] = hit.primitive.cell;
    let a = f64::from(hit.u) * f64::from(rates.n_u) - f64::from(i);
    let b = f64::from(hit.v) * f64::from(rates.n_v) - f64::from(j);
    if hit.primitive.half == 0 { [a, b] } else { [1.0 - a, 1.0 - b] }
}

impl LatticeRay {
    fn new(mesh: &WorldMesh, ray: &Ray) -> Self {
        let lattice = mesh.surface().lattice();
        let lattice_from_object = DAffine3::from_translation(DVec3::splat(LATTICE_SHIFT))
            * DAffine3::from_scale(DVec3::splat(lattice.step.recip()))
            * DAffine3::from_translation(-lattice.center);
        let to = lattice_from_object * mesh.world_from_object().inverse();
        Self { origin: to.transform_point3(ray.origin), direction: to.transform_vector3(ray.direction) }
    }

    /// Steps by which rounding a parameter to f32 moves a point of the ray.
    fn rounding(&self, t: f64) -> f64 {
        t.abs() * 2f64.powi(-23) * self.direction.length()
    }
}

impl Triangle {
    fn point(&self, a: f64, b: f64) -> DVec3 {
        let [p, q, r] = self.0;
        p + a * (q - p) + b * (r - p)
    }

    fn normal(&self) -> DVec3 {
        let [p, q, r] = self.0;
        (q - p).cross(r - p)
    }

    fn longest(&self) -> f64 {
        let [p, q, r] = self.0;
        (q - p).length().max((r - q).length()).max((p - r).length())
    }

    fn seen_by(&self, ray: &LatticeRay) -> View {
        let along = ray.direction.normalize();
        let from_ray = self.0.map(|p| (p - ray.origin).reject_from_normalized(along));
        let edge = |i: usize| from_ray[(i + 1) % 3] - from_ray[i];
        let area = edge(0).cross(edge(1)).dot(along);
        let beside = |i: usize| area.signum() * from_ray[i].cross(edge(i)).dot(along) / edge(i).length();
        let (p, longest) = (self.0[0], self.longest());
        // A triangle seen from its edge: sideways errors become long along the ray, but never longer than the triangle.
        let steepness = longest * longest / area.abs();
        let uncertainty = ((SLACK + longest * 2f64.powi(-22)) * steepness).min(longest) + SLACK;
        let t = self.normal().dot(p - ray.origin) / self.normal().dot(ray.direction);
        View { inside: (0..3).map(beside).fold(f64::INFINITY, f64::min), t, uncertainty }
    }
}

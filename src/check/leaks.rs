//! Rays at targets, on all threads.

use super::incidence::Incidence;
use super::targets::{Target, TargetFinder};
use crate::ids::PatchId;
use crate::math::{Intersect, Ray};
use crate::mesh::shapes::noise::Random;
use crate::parallel::on_threads;
use crate::scene::world::WorldMesh;
use glam::{DAffine3, DVec3};
use parking_lot::Mutex;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// How to test.
#[derive(Clone, Copy, Debug)]
pub struct LeakSettings {
    /// Rays to trace.
    pub rays: u64,
    /// Decides where they go.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
}

/// A ray that passed where it should not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leak {
    /// The patch aimed at.
    pub patch: u32,
    /// What was aimed at: an edge, a vertex, a polygon's inner line or centre, or the inside of a patch.
    pub target: String,
    /// Ray origin in world space.
    pub origin: [f64; 3],
    /// Ray direction in world space.
    pub direction: [f64; 3],
    /// The target's ray parameter, and that of the hit if there was one.
    pub t: [Option<f32>; 2],
}

/// What the rays met.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LeakReport {
    /// Rays that were traced.
    pub rays: u64,
    /// Those that passed their target.
    pub leaks: u64,
    /// Those of them that hit nothing at all.
    pub hit_nothing: u64,
    /// Lines and vertices aimed at, many rays each.
    pub targets: u64,
    /// Rays that were drawn but not traced: their target was seen edge-on, is too small for single precision, or
    /// they would have started among its triangles.
    pub unfit: u64,
    /// Some of the leaks.
    pub examples: Vec<Leak>,
}

/// Rays of a task.
const TASK_RAYS: u64 = 4096;
/// Points of a target that rays are aimed at.
const POINTS_PER_TARGET: u32 = 8;
/// Rays drawn for each point.
const RAYS_PER_POINT: u32 = 16;
/// Draws of a task for each ray it is to trace, before it gives up: a mesh may have no target at all.
const MAX_DRAWS: u64 = 16;
/// Leaks that are kept.
const MAX_EXAMPLES: usize = 10;
/// A mesh is up to so many lattice steps wide.
const MESH_WIDTH: f64 = (1 << 23) as f64;

/// Aims rays at a mesh until `cancel` is set; `progress` is told how many are done. The tracers, one for each thread,
/// see the mesh alone.
pub fn find_leaks<T: Intersect>(
    mesh: &WorldMesh,
    incidence: &Incidence,
    settings: &LeakSettings,
    cancel: &AtomicBool,
    progress: &(impl Fn(u64) + Sync),
    make_tracer: impl Fn() -> T + Sync,
) -> LeakReport {
    let patches: Vec<PatchId> = mesh.surface().visible_patches().collect();
    let n_tasks = if patches.is_empty() { 0 } else { settings.rays.div_ceil(TASK_RAYS) };
    let (next, done) = (AtomicU64::new(0), AtomicU64::new(0));
    let total = Mutex::new(Vec::new());
    let world_from_lattice = mesh.lattice_from_world().inverse();
    let work = || {
        let targets = TargetFinder::new(mesh, incidence, &patches);
        let mut worker = Worker { world_from_lattice, targets, tracer: make_tracer(), report: LeakReport::default() };
        while !cancel.load(Ordering::Relaxed) {
            let task = next.fetch_add(1, Ordering::Relaxed);
            if task >= n_tasks {
                break;
            }
            let n_rays = TASK_RAYS.min(settings.rays - task * TASK_RAYS);
            worker.run(&mut Random::new(settings.seed, task), n_rays);
            total.lock().push((task, std::mem::take(&mut worker.report)));
            progress(done.fetch_add(n_rays, Ordering::Relaxed) + n_rays);
        }
    };
    on_threads(settings.threads, work);
    let mut reports = total.into_inner();
    reports.sort_by_key(|(task, _)| *task);
    reports.into_iter().fold(LeakReport::default(), |sum, (_, report)| sum.with(report))
}

impl LeakReport {
    fn with(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.leaks += other.leaks;
        self.hit_nothing += other.hit_nothing;
        self.targets += other.targets;
        self.unfit += other.unfit;
        self.examples.extend(other.examples);
        self.examples.truncate(MAX_EXAMPLES);
        self
    }
}

struct Worker<'a, T> {
    world_from_lattice: DAffine3,
    targets: TargetFinder<'a>,
    tracer: T,
    report: LeakReport,
}

/// A ray in lattice space: it comes from `distance` steps before the point that it is aimed at.
#[derive(Clone, Copy)]
struct Aim {
    at: DVec3,
    direction: DVec3,
    distance: f64,
}

impl<T: Intersect> Worker<'_, T> {
    fn run(&mut self, random: &mut Random, n_rays: u64) {
        let mut draws = MAX_DRAWS * n_rays;
        while self.report.rays < n_rays && draws > 0 {
            draws = draws.saturating_sub(u64::from(POINTS_PER_TARGET * RAYS_PER_POINT));
            let Some(target) = self.targets.draw(random) else { continue };
            self.report.targets += 1;
            for _ in 0..POINTS_PER_TARGET {
                let at = target.point(random);
                for _ in 0..RAYS_PER_POINT.min((n_rays - self.report.rays) as u32) {
                    self.shoot(&target, Aim::draw(at, random), random);
                }
            }
        }
    }

    fn shoot(&mut self, target: &Target, aim: Aim, random: &mut Random) {
        let margin = self.error(aim);
        let is_before = aim.distance > target.outline.depth(aim.at, -aim.direction) + margin;
        if !is_before || !target.outline.encloses(aim.at, aim.direction, margin) {
            self.report.unfit += 1;
            return;
        }
        self.report.rays += 1;
        // The point is at this t; a power of two, so that directions of all lengths are tried and none is rounded.
        let t_target = f64::powi(2.0, random.below(21) as i32 - 10);
        let ray = self.world_ray(aim, t_target);
        let last =
            t_target * (1.0 + (target.outline.depth(aim.at, aim.direction) + margin) / aim.distance) * (1.0 + 1e-6);
        let hit = if random.chance(0.5) {
            let hit = self.tracer.closest(&ray).map(|hit| hit.t);
            (hit, hit.is_some_and(|t| f64::from(t) <= last))
        } else {
            (None, self.tracer.occluded(&Ray { t_max: last as f32, ..ray }))
        };
        if let (t, false) = hit {
            let t = t.or_else(|| self.tracer.closest(&ray).map(|hit| hit.t));
            self.report.leaks += 1;
            self.report.hit_nothing += u64::from(t.is_none());
            if self.report.examples.len() < MAX_EXAMPLES {
                let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
                let (patch, kind) = (target.patch.0, target.kind.to_owned());
                self.report.examples.push(Leak {
                    patch,
                    target: kind,
                    origin,
                    direction,
                    t: [Some(t_target as f32), t],
                });
            }
        }
    }

    /// How far, across the ray and in lattice steps, a triangle can seem from where it is: origin and direction are
    /// rounded to single precision, and so is each corner as seen from the origin (`LatticeRay` has the sums).
    fn error(&self, aim: Aim) -> f64 {
        let reach = aim.origin().abs().max_element() + MESH_WIDTH;
        let in_world = self.world_from_lattice.transform_point3(aim.origin()).abs().max_element();
        let world_step = self.world_from_lattice.matrix3.x_axis.length();
        16.0 * f64::powi(2.0, -24) * reach + 1.0 + 8.0 * f64::EPSILON * in_world / world_step
    }

    fn world_ray(&self, aim: Aim, t_target: f64) -> Ray {
        let origin = self.world_from_lattice.transform_point3(aim.origin());
        Ray::new(origin, self.world_from_lattice.transform_vector3(aim.direction * (aim.distance / t_target)))
    }
}

impl Aim {
    fn origin(self) -> DVec3 {
        self.at - self.distance * self.direction
    }

    fn draw(at: DVec3, random: &mut Random) -> Self {
        let distance = if random.chance(0.5) {
            MESH_WIDTH * random.within(1.0, 3.0)
        } else {
            MESH_WIDTH * f64::powf(2.0, random.within(-20.0, 0.0))
        };
        Self { at, direction: draw_direction(random), distance }
    }
}

/// A unit vector: along an axis with zeros of both signs, along a diagonal, or anywhere.
fn draw_direction(random: &mut Random) -> DVec3 {
    let simple = random.below(4);
    loop {
        let mut component = || match simple {
            0 => [1.0, -1.0, 0.0, -0.0, 0.0, -0.0][random.below(6)],
            _ => random.within(-1.0, 1.0),
        };
        let v = DVec3::new(component(), component(), component());
        if v.length_squared() > 1e-4 && v.length_squared() <= if simple == 0 { 3.0 } else { 1.0 } {
            return v.normalize();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CacheConfig;
    use crate::ids::MeshId;
    use crate::math::Hit;
    use crate::mesh::{ControlMesh, shapes};
    use crate::scene::intersect::Intersector;
    use crate::scene::rate::DicingRate;
    use crate::scene::world::{GridCache, World};

    /// A tracer with a defect: what `misses` holds for is not hit.
    struct Faulty<'a, F>(Intersector<'a>, F);

    impl<F: Fn(&Hit) -> bool> Intersect for Faulty<'_, F> {
        fn closest(&mut self, ray: &Ray) -> Option<Hit> {
            self.0.closest(ray).filter(|hit| !self.1(hit))
        }

        fn occluded(&mut self, ray: &Ray) -> bool {
            self.closest(ray).is_some()
        }
    }

    fn report(
        mesh: ControlMesh,
        rate: DicingRate,
        threads: usize,
        misses: impl Fn(&Hit) -> bool + Copy + Sync,
    ) -> LeakReport {
        let world = World::new(vec![WorldMesh::new(mesh, DAffine3::IDENTITY, rate, 1).unwrap()]);
        let cache = GridCache::new(&world, CacheConfig::with_bytes(8 << 20)).unwrap();
        let mesh = world.mesh(MeshId(0));
        let settings = LeakSettings { rays: 20_000, seed: 1, threads };
        let make_tracer = || Faulty(Intersector::new(&world, &cache), misses);
        find_leaks(mesh, &Incidence::new(mesh.surface()), &settings, &AtomicBool::new(false), &|_| (), make_tracer)
    }

    #[test]
    fn a_sound_tracer_leaks_nothing_and_a_faulty_one_is_caught() {
        let sound = report(shapes::prism(5), DicingRate::Random(3), 1, |_| false);
        assert_eq!((sound.rays, sound.leaks), (20_000, 0), "{:?}", sound.examples);
        // One triangle in some hundreds.
        let torn = report(shapes::prism(5), DicingRate::Fixed(8), 1, |hit| {
            hit.primitive.patch == PatchId(3) && hit.primitive.cell == [3, 0] && hit.primitive.half == 0
        });
        assert!(torn.leaks > 20 && torn.examples.len() == MAX_EXAMPLES, "{torn:?}");
        // A crack along the borders of patches, a millionth of a patch wide.
        let cracked = report(shapes::cube(), DicingRate::Fixed(8), 1, |hit| hit.u.min(hit.v) < 1e-6);
        assert!(cracked.leaks > 1000, "{cracked:?}");
    }

    #[test]
    fn threads_do_not_change_the_report() {
        let [one, three] =
            [1, 3].map(|threads| report(shapes::fin(), DicingRate::Random(5), threads, |hit| hit.u < 0.1));
        assert!(one == three && one.leaks > 0);
    }
}

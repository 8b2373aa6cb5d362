//! The pinhole camera and its primary rays.

use super::description::CameraDescription;
use crate::math::{DBounds, Ray, RayBounds};
use glam::{DVec2, DVec3};

/// Distance of the default camera from the centre of what it frames, in diagonals of its box.
const DEFAULT_DISTANCE: f64 = 1.35;

/// A pinhole camera in world space, ready to make rays. All arithmetic is f64.
///
/// ```text
///     pixel (0,0) ┌──────────┐        row 0 is the top row; pixel (x, y) covers [x, x+1) × [y, y+1)
///                 │    up    │        sx = (x / W · 2 − 1) · h · W / H      h = tan(fov / 2)
///                 │    └ right        sy = (1 − y / H · 2) · h
///                 └──────────┘ (W,H)  direction = normalize(forward + sx · right + sy · up)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    tan_half_fov: f64,
    focus_distance: f64,
}

impl Camera {
    /// The camera that `description` asks for.
    pub fn new(description: &CameraDescription) -> Self {
        let CameraDescription { eye, at, up, fov } = *description;
        let forward = (at - eye).normalize();
        let right = forward.cross(up).normalize();
        Self {
            eye,
            forward,
            right,
            up: right.cross(forward),
            tan_half_fov: (fov * std::f64::consts::PI / 360.0).tan(),
            focus_distance: (at - eye).length(),
        }
    }

    /// Position of the pinhole.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Unit vector into the picture.
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// Distance from the eye to the point it looks at: the scale of `debug:depth`.
    pub fn focus_distance(&self) -> f64 {
        self.focus_distance
    }

    /// The ray through `raster`, in pixels from the top left corner, of a picture of `size` pixels. Its direction has
    /// length 1. The centre of pixel (x, y) is (x + 0.5, y + 0.5).
    pub fn ray(&self, raster: DVec2, [width, height]: [u32; 2]) -> Ray {
        let (w, h) = (f64::from(width), f64::from(height));
        let sx = (raster.x / w * 2.0 - 1.0) * self.tan_half_fov * w / h;
        let sy = (1.0 - raster.y / h * 2.0) * self.tan_half_fov;
        Ray::new(self.eye, (self.forward + sx * self.right + sy * self.up).normalize())
    }

    /// The bundle of the rays through a part of a picture of `size` pixels, between two corners in pixels.
    ///
    /// A component of a direction of length 1 differs from a blend of those at the corners by an eighth of the second
    /// derivatives, which are 3 at most, times the squares of the sides on the plane at distance 1.
    pub fn bundle(&self, [low, high]: [DVec2; 2], size: [u32; 2]) -> RayBounds {
        let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        let bundle: RayBounds = corners.into_iter().map(|corner| self.ray(corner, size)).collect();
        let sides = (high - low) * (2.0 * self.tan_half_fov / f64::from(size[1]));
        RayBounds { direction: bundle.direction.expanded(0.375 * sides.length_squared()), ..bundle }
    }

    /// Coordinates of a point of world space along right, up and forward, from the eye. The last is its depth.
    pub fn view_from_world(&self, p: DVec3) -> DVec3 {
        self.view_from_world_vector(p - self.eye)
    }

    /// As [`view_from_world`](Self::view_from_world) for a vector.
    pub fn view_from_world_vector(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.right), v.dot(self.up), v.dot(self.forward))
    }

    /// Where a point of view space with positive depth is seen: the inverse of [`ray`](Self::ray).
    pub fn raster_from_view(&self, p: DVec3, [width, height]: [u32; 2]) -> DVec2 {
        let (w, h) = (f64::from(width), f64::from(height));
        let scale = 0.5 * h / (self.tan_half_fov * p.z);
        DVec2::new(0.5 * w + scale * p.x, 0.5 * h - scale * p.y)
    }

    /// How many pixels a length of 1 covers at distance 1, in the middle of a picture `height` pixels high.
    pub fn pixels_per_unit(&self, height: u32) -> f64 {
        f64::from(height) / (2.0 * self.tan_half_fov)
    }
}

impl CameraDescription {
    /// The default camera: looks at the centre of `bounds` (world space, of the vertices that faces use) from direction
    /// (1, 0.6, 1.2), 1.35 diagonals away. A box without extent is framed as if its diagonal were 1.
    pub fn framing(bounds: DBounds) -> Self {
        let at = if bounds.is_empty() { DVec3::ZERO } else { bounds.center() };
        let diagonal = if bounds.diagonal() > 0.0 { bounds.diagonal() } else { 1.0 };
        let eye = at + (DEFAULT_DISTANCE * diagonal) * DVec3::new(1.0, 0.6, 1.2).normalize();
        Self { eye, at, up: DVec3::Y, fov: CameraDescription::DEFAULT_FOV }
    }

    /// The same for pictures of that size: if they are narrower than 4 to 3, from so far away that they are as wide as
    /// such a one.
    pub fn for_pictures_of(self, [width, height]: [u32; 2]) -> Self {
        let narrower = 4.0 * f64::from(height) / (3.0 * f64::from(width));
        if narrower > 1.0 { Self { eye: self.at + narrower * (self.eye - self.at), ..self } } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube_camera() -> Camera {
        let bounds = [DVec3::splat(-1.0), DVec3::splat(1.0)].into_iter().collect();
        Camera::new(&CameraDescription::framing(bounds))
    }

    #[test]
    fn default_camera_stands_where_the_formula_says() {
        let camera = cube_camera();
        let expected = 1.35 * 12.0_f64.sqrt() / 2.8_f64.sqrt() * DVec3::new(1.0, 0.6, 1.2);
        assert!((camera.eye() - expected).length() < 1e-14);
        assert!((camera.forward() + expected.normalize()).length() < 1e-15);
    }

    #[test]
    fn narrow_pictures_are_as_wide_as_others() {
        let framing = CameraDescription::framing([DVec3::splat(-1.0), DVec3::splat(1.0)].into_iter().collect());
        assert_eq!(framing.for_pictures_of([800, 600]), framing);
        assert_eq!(framing.for_pictures_of([1920, 1080]), framing);
        let reach = |size: [u32; 2]| {
            let camera = Camera::new(&framing.for_pictures_of(size));
            camera.raster_from_view(camera.view_from_world(camera.right), size).x / f64::from(size[0])
        };
        assert!((reach([300, 600]) - reach([800, 600])).abs() < 1e-12);
    }

    #[test]
    fn the_middle_of_the_picture_looks_forward() {
        let ray = cube_camera().ray(DVec2::new(400.0, 300.0), [800, 600]);
        assert!((ray.direction - cube_camera().forward()).length() < 1e-15);
    }

    #[test]
    fn the_bundle_of_a_tile_holds_its_rays_and_few_others() {
        for (size, side) in [([640, 480], 16.0), ([64, 48], 64.0), ([100, 800], 3.0)] {
            let [width, height] = size.map(f64::from);
            let low = DVec2::new(0.3 * width, 0.7 * height).floor();
            let corners = [low, (low + side).min(DVec2::new(width, height))];
            let bundle = cube_camera().bundle(corners, size);
            for k in 0..=400 {
                let place = DVec2::new(f64::from(k % 21), f64::from(k / 21)) / DVec2::new(20.0, 19.05);
                let ray = cube_camera().ray(corners[0] + place * (corners[1] - corners[0]), size);
                assert!(bundle.contains(&ray), "{size:?}, {place}");
            }
            for beyond in [DVec2::new(-1.5, 0.5), DVec2::new(0.5, 4.0)] {
                let ray = cube_camera().ray(corners[0] + beyond * (corners[1] - corners[0]), size);
                assert!(!bundle.contains(&ray), "{size:?}, {beyond}");
            }
        }
    }

    #[test]
    fn row_zero_is_at_the_top_and_half_the_field_of_view_above_the_middle() {
        let camera = cube_camera();
        let top = camera.ray(DVec2::new(400.0, 0.0), [800, 600]).direction;
        assert!(top.y > camera.forward().y);
        assert!((top.dot(camera.forward()).acos().to_degrees() - CameraDescription::DEFAULT_FOV / 2.0).abs() < 1e-9);
    }

    #[test]
    fn what_a_ray_passes_is_seen_where_the_ray_started() {
        let camera = cube_camera();
        let raster = DVec2::new(17.5, 301.25);
        let ray = camera.ray(raster, [800, 600]);
        let back = camera.raster_from_view(camera.view_from_world(ray.origin + 3.0 * ray.direction), [800, 600]);
        assert!((back - raster).length() < 1e-9);
    }

    #[test]
    fn primary_rays_follow_the_formula_of_the_peers_to_the_bit() {
        let camera = cube_camera();
        let (x, y, w, h) = (17.0, 301.0, 800.0, 600.0);
        let t = (35.0 * std::f64::consts::PI / 360.0).tan();
        let (sx, sy) = (((x + 0.5) / w * 2.0 - 1.0) * t * w / h, (1.0 - (y + 0.5) / h * 2.0) * t);
        let d = camera.forward + sx * camera.right + sy * camera.up;
        let expected = (1.0 / (d.x * d.x + d.y * d.y + d.z * d.z).sqrt()) * d;
        assert_eq!(camera.ray(DVec2::new(17.5, 301.5), [800, 600]).direction, expected);
    }
}

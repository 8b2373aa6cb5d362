//! How surfaces reflect and refract: the optics behind [`Material`].

use super::description::{Albedo, Material};
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

impl Albedo {
    /// The cube of a checker that a point of world space lies in, by its lowest corner in cubes; zero where there is
    /// one colour.
    pub fn cube_at(&self, position: DVec3) -> DVec3 {
        match *self {
            Self::Constant(_) => DVec3::ZERO,
            Self::Checker { size, .. } => (position / size).floor(),
        }
    }

    /// The colour at a point of world space.
    pub fn at(&self, position: DVec3) -> Vec3 {
        match *self {
            Self::Constant(colour) => colour,
            Self::Checker { even, odd, .. } => {
                let cube = self.cube_at(position);
                // Parity by arithmetic, as cells may lie beyond the range of integers.
                if (cube.x + cube.y + cube.z).rem_euclid(2.0) < 1.0 { even } else { odd }
            }
        }
    }
}

impl Material {
    /// Radiance towards `to_eye` per unit of irradiance on a surface that faces the light: Lambert plus normalised
    /// Blinn-Phong, times the cosine. All directions are unit vectors away from the surface; glass has no diffuse part.
    pub fn reflect_light(&self, albedo: Vec3, normal: Vec3, to_light: Vec3, to_eye: Vec3) -> Vec3 {
        let cosine = normal.dot(to_light);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        let diffuse = if self.glass.is_some() { Vec3::ZERO } else { albedo / PI };
        (diffuse + self.highlight(normal, to_light, to_eye)) * cosine
    }

    /// The most that [`reflect_light`](Self::reflect_light) can be in a channel, whatever the directions.
    pub fn most_reflected(&self) -> f32 {
        let albedo = match self.diffuse {
            Albedo::Constant(albedo) => albedo,
            Albedo::Checker { even, odd, .. } => even.max(odd),
        };
        (albedo / PI + self.specular * self.highlight_factor()).max_element()
    }

    /// Blinn-Phong with the factor (n + 8) / 8π that keeps the reflected energy about the same for every exponent n.
    fn highlight(&self, normal: Vec3, to_light: Vec3, to_eye: Vec3) -> Vec3 {
        if self.specular == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let half = (to_light + to_eye).normalize_or_zero();
        let lobe = normal.dot(half).max(0.0).powf(self.shininess);
        self.specular * (lobe * self.highlight_factor())
    }

    fn highlight_factor(&self) -> f32 {
        (self.shininess + 8.0) / (8.0 * PI)
    }
}

/// What a smooth boundary between two clear media does to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Share of unpolarised light that is reflected, 0..=1; 1 beyond the critical angle.
    pub reflectance: f64,
    /// Unit direction of the refracted ray; `None` under total internal reflection.
    pub refracted: Option<DVec3>,
}

impl Interface {
    /// Snell's law and Fresnel's equations for a ray along the unit vector `direction` that meets a surface whose unit
    /// `normal` points against it. `eta` is the index of refraction behind the surface relative to the one before it.
    pub fn new(direction: DVec3, normal: DVec3, eta: f64) -> Self {
        let cos_i = (-direction.dot(normal)).clamp(0.0, 1.0);
        let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
        if sin2_t >= 1.0 {
            return Self { reflectance: 1.0, refracted: None };
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
        let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
        Self {
            reflectance: 0.5 * (parallel * parallel + perpendicular * perpendicular),
            refracted: Some((direction / eta + (cos_i / eta - cos_t) * normal).normalize()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_degrees(angle: f64, eta: f64) -> Interface {
        let (sin, cos) = angle.to_radians().sin_cos();
        Interface::new(DVec3::new(sin, -cos, 0.0), DVec3::Y, eta)
    }

    #[test]
    fn glass_reflects_four_percent_at_normal_incidence_from_both_sides() {
        assert!((at_degrees(0.0, 1.5).reflectance - 0.04).abs() < 1e-12);
        assert!((at_degrees(0.0, 1.0 / 1.5).reflectance - 0.04).abs() < 1e-12);
    }

    #[test]
    fn parallel_light_is_not_reflected_at_brewsters_angle() {
        // There the reflectance is half that of perpendicular light, ((n² - 1) / (n² + 1))².
        let n: f64 = 1.5;
        let expected = 0.5 * ((n * n - 1.0) / (n * n + 1.0)).powi(2);
        assert!((at_degrees(n.atan().to_degrees(), n).reflectance - expected).abs() < 1e-12);
    }

    #[test]
    fn light_leaving_glass_is_totally_reflected_beyond_the_critical_angle() {
        let critical = (1.0_f64 / 1.5).asin().to_degrees();
        assert!(at_degrees(critical - 0.01, 1.0 / 1.5).refracted.is_some());
        let beyond = at_degrees(critical + 0.01, 1.0 / 1.5);
        assert_eq!((beyond.reflectance, beyond.refracted), (1.0, None));
    }

    #[test]
    fn refraction_obeys_snells_law() {
        let refracted = at_degrees(40.0, 1.5).refracted.unwrap();
        assert!((refracted.x * 1.5 - 40.0_f64.to_radians().sin()).abs() < 1e-12);
        assert!(refracted.y < 0.0);
        assert_eq!(at_degrees(40.0, 1.0).reflectance, 0.0);
    }

    #[test]
    fn checkers_alternate_in_cubes_with_a_corner_at_the_origin() {
        let checker = Albedo::Checker { even: Vec3::ONE, odd: Vec3::ZERO, size: 2.0 };
        assert_eq!(checker.at(DVec3::splat(0.5)), Vec3::ONE);
        assert_eq!(checker.at(DVec3::new(-0.5, 0.5, 0.5)), Vec3::ZERO);
        assert_eq!(checker.at(DVec3::new(-0.5, 0.5, 2.5)), Vec3::ONE);
    }

    #[test]
    fn cubes_are_told_apart_though_their_colours_are_alike() {
        let checker = Albedo::Checker { even: Vec3::ONE, odd: Vec3::ZERO, size: 2.0 };
        assert_eq!(checker.cube_at(DVec3::new(1.9, 0.5, -0.5)), DVec3::new(0.0, 0.0, -1.0));
        let [a, b] = [DVec3::splat(0.5), DVec3::new(2.5, 2.5, 0.5)];
        assert_eq!(checker.at(a), checker.at(b));
        assert_ne!(checker.cube_at(a), checker.cube_at(b));
        assert_eq!(Albedo::Constant(Vec3::ONE).cube_at(a), Albedo::Constant(Vec3::ONE).cube_at(b));
    }

    #[test]
    fn a_white_lambert_surface_turns_irradiance_pi_into_radiance_one() {
        let white = Material { specular: Vec3::ZERO, ..Material::default() };
        let radiance = PI * white.reflect_light(Vec3::ONE, Vec3::Y, Vec3::Y, Vec3::Y);
        assert!((radiance - Vec3::ONE).abs().max_element() < 1e-6);
    }

    #[test]
    fn nothing_is_reflected_more_brightly_than_the_most() {
        let material = Material { shininess: 90.0, specular: Vec3::splat(0.25), ..Material::default() };
        let reflected = material.reflect_light(Vec3::splat(0.7), Vec3::Y, Vec3::Y, Vec3::Y).max_element();
        assert!((reflected / material.most_reflected() - 1.0).abs() < 1e-6);
    }
}

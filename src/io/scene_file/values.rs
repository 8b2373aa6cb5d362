//! Values that check themselves while serde reads them, so that an error carries the line of the value.

use crate::image::display::linear_from_srgb;
use glam::{DQuat, DVec3, EulerRot, Vec3};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use std::fmt;
use std::str::FromStr;

/// Numbers beyond this are refused: products of a few of them must stay far from the end of f64.
const MAX_NUMBER: f64 = 1e30;

/// A finite number.
pub struct Number(pub f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        usable(f64::deserialize(d)?).map(Self)
    }
}

fn usable<E: Error>(value: f64) -> Result<f64, E> {
    if value.abs() <= MAX_NUMBER {
        return Ok(value);
    }
    Err(E::custom(format!("{value:e} is no number that can be used: write one within ±{MAX_NUMBER:e}")))
}

/// A number above 0.
pub struct Positive(pub f64);

impl<'de> Deserialize<'de> for Positive {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let Number(value) = Number::deserialize(d)?;
        if value > 0.0 { Ok(Self(value)) } else { Err(D::Error::custom(format!("{value} should be above 0"))) }
    }
}

/// `[x, y, z]`.
pub struct Point(pub DVec3);

impl<'de> Deserialize<'de> for Point {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let [x, y, z] = <[Number; 3]>::deserialize(d)?;
        Ok(Self(DVec3::new(x.0, y.0, z.0)))
    }
}

/// `[x, y, z]`, not zero; kept as a unit vector.
pub struct Direction(pub DVec3);

impl<'de> Deserialize<'de> for Direction {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let Point(p) = Point::deserialize(d)?;
        // Scaled first: squares of tiny or huge components would vanish or overflow.
        let unit = (p / p.abs().max_element()).try_normalize();
        unit.map(Self).ok_or_else(|| D::Error::custom("[0, 0, 0] is no direction"))
    }
}

/// A linear colour of any brightness: a grey, `[r, g, b]`, or `"#rrggbb"` in sRGB.
pub struct Colour(pub Vec3);

impl<'de> Deserialize<'de> for Colour {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let colour = d.deserialize_any(ColourVisitor)?;
        if colour.cmplt(Vec3::ZERO).any() {
            return Err(D::Error::custom("a colour cannot be negative"));
        }
        Ok(Self(colour))
    }
}

/// A colour within 0..1: a share of the light that arrives.
pub struct Share(pub Vec3);

impl<'de> Deserialize<'de> for Share {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let Colour(colour) = Colour::deserialize(d)?;
        if colour.cmpgt(Vec3::ONE).any() {
            return Err(D::Error::custom(
                "a surface cannot give back more light than arrives: write values within 0..1",
            ));
        }
        Ok(Self(colour))
    }
}

struct ColourVisitor;

impl<'de> Visitor<'de> for ColourVisitor {
    type Value = Vec3;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a colour: a grey such as 0.5, [red, green, blue] or \"#rrggbb\"")
    }

    fn visit_f64<E: Error>(self, grey: f64) -> Result<Vec3, E> {
        usable(grey).map(|grey| Vec3::splat(grey as f32))
    }

    fn visit_i64<E: Error>(self, grey: i64) -> Result<Vec3, E> {
        self.visit_f64(grey as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Vec3, E> {
        let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
        let packed = digits.and_then(|d| u32::from_str_radix(d, 16).ok());
        let [_, r, g, b] =
            packed.ok_or_else(|| E::custom(format!("'{text}' is no colour: write \"#rrggbb\"")))?.to_be_bytes();
        Ok(Vec3::new(f32::from(r), f32::from(g), f32::from(b)).map(|v| linear_from_srgb(v / 255.0)))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec3, A::Error> {
        let mut rgb = [0.0; 3];
        for (i, channel) in rgb.iter_mut().enumerate() {
            let Number(value) = seq.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
            *channel = value as f32;
        }
        match seq.next_element::<Number>()? {
            None => Ok(Vec3::from_array(rgb)),
            Some(_) => Err(A::Error::invalid_length(4, &self)),
        }
    }
}

/// `2` or `[2, 1, 1]`.
pub struct Scale(pub DVec3);

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_any(ScaleVisitor).map(Self)
    }
}

struct ScaleVisitor;

impl<'de> Visitor<'de> for ScaleVisitor {
    type Value = DVec3;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a scale: a number or [x, y, z]")
    }

    fn visit_f64<E: Error>(self, all: f64) -> Result<DVec3, E> {
        usable(all).map(DVec3::splat)
    }

    fn visit_i64<E: Error>(self, all: i64) -> Result<DVec3, E> {
        self.visit_f64(all as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<DVec3, A::Error> {
        let Point(scale) = Point::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))?;
        Ok(scale)
    }
}

/// `{ axis = [x, y, z], degrees = a }`, or `[x, y, z]` in degrees about the axes, x first.
pub struct Rotation(pub DQuat);

impl<'de> Deserialize<'de> for Rotation {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_any(RotationVisitor).map(Self)
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    axis: Direction,
    degrees: Number,
}

struct RotationVisitor;

impl<'de> Visitor<'de> for RotationVisitor {
    type Value = DQuat;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a rotation: { axis = [x, y, z], degrees = a } or [x, y, z] in degrees")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<DQuat, A::Error> {
        let Point(degrees) = Point::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))?;
        let [x, y, z] = degrees.to_array().map(f64::to_radians);
        Ok(DQuat::from_euler(EulerRot::ZYX, z, y, x))
    }

    fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<DQuat, A::Error> {
        let turn = AxisAngle::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
        Ok(DQuat::from_axis_angle(turn.axis.0, turn.degrees.0.to_radians()))
    }
}

/// A string that reads as `T`, such as a rate or an integrator.
pub fn parsed<'de, D, T>(d: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr,
    T::Err: fmt::Display,
{
    String::deserialize(d)?.parse().map(Some).map_err(D::Error::custom)
}

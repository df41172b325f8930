//! The emitter `sunsky` from scene files.

use super::parse::{colour_of, rotation};
use super::sky::{SkyOptions, SunSky};
use super::{DATE_PARTS, LEAST_APERTURE_DEG, Observer, SUN_APERTURE_DEG};
use crate::desc::{Params, Result};
use crate::math::{DVec3, Rgb};
use crate::texture::Usage;

/// What says when and where, instead of `sun_direction`.
const RECORD: [&str; 9] =
    ["latitude", "longitude", "timezone", "year", "month", "day", "hour", "minute", "second"];

pub(super) fn sun_sky(params: &Params, weight: f32) -> Result<SunSky> {
    let to_world = rotation(params)?;
    let sun = match params.vector_opt("sun_direction")? {
        Some(direction) => {
            if let Some(name) = RECORD.into_iter().find(|name| params.has(name)) {
                let message = format!("give either `sun_direction` or `{name}`, not both");
                return Err(params.error_at(name, message));
            }
            let direction = direction.try_normalize().ok_or_else(|| {
                params.error_at("sun_direction", "`sun_direction` gives no direction: its length is zero")
            })?;
            to_world.transpose() * direction
        }
        None => {
            let sun = observer(params)?.sun();
            let ((sin_z, cos_z), (sin_a, cos_a)) = (sun.zenith.sin_cos(), sun.azimuth.sin_cos());
            DVec3::new(-cos_a * sin_z, -sin_a * sin_z, cos_z)
        }
    };
    if !(sun.z >= 0.0) {
        let below = -sun.z.asin().to_degrees();
        let name = if params.has("sun_direction") { "sun_direction" } else { "hour" };
        return Err(params.error_at(
            name,
            format!("the sun is {below:.1} degrees below the horizon: the sky has no night"),
        ));
    }
    let turbidity = params.float("turbidity", 3.0)?;
    if !(1.0..=10.0).contains(&turbidity) {
        let message = format!("`turbidity` must lie between 1 and 10, found {turbidity}");
        return Err(params.error_at("turbidity", message));
    }
    let aperture = params.float("sun_aperture", SUN_APERTURE_DEG)?;
    if !(LEAST_APERTURE_DEG..180.0).contains(&aperture) {
        let message =
            format!("`sun_aperture` must lie between {LEAST_APERTURE_DEG} and 180 degrees, found {aperture}");
        return Err(params.error_at("sun_aperture", message));
    }
    Ok(SunSky::new(&SkyOptions {
        turbidity,
        albedo: colour_of(params, "albedo", Rgb::splat(0.3), Usage::Reflectance)?,
        sun_scale: scale(params, "sun_scale")?,
        sky_scale: scale(params, "sky_scale")?,
        aperture: aperture.to_radians(),
        complex_sun: params.bool("complex_sun", false)?,
        sun,
        to_world,
        weight,
    }))
}

fn observer(params: &Params) -> Result<Observer> {
    let o = Observer::default();
    Ok(Observer {
        latitude: params.float("latitude", o.latitude)?,
        longitude: params.float("longitude", o.longitude)?,
        timezone: params.float("timezone", o.timezone)?,
        year: whole(params, "year", o.year)?,
        month: whole(params, "month", o.month)?,
        day: whole(params, "day", o.day)?,
        clock: [
            params.float("hour", o.clock[0])?,
            params.float("minute", o.clock[1])?,
            params.float("second", o.clock[2])?,
        ],
    })
}

fn whole(params: &Params, name: &'static str, default: i64) -> Result<i64> {
    let value = params.int(name, default)?;
    if !DATE_PARTS.contains(&value) {
        return Err(params.error_at(name, format!("`{name}` is no part of a date: {value}")));
    }
    Ok(value)
}

fn scale(params: &Params, name: &'static str) -> Result<f64> {
    let value = params.float(name, 1.0)?;
    if !(value >= 0.0) || !((value * 1e6) as f32).is_finite() {
        return Err(params.error_at(name, format!("`{name}` must be finite and not negative, found {value}")));
    }
    Ok(value)
}

//! Where the sun stands, by place and time.
//!
//! The algorithm of the Plataforma Solar de Almería: Blanco-Muriel,
//! Alarcón-Padilla, López-Moratalla, Lara-Coira 2001, "Computing the solar
//! vector", Solar Energy 70(5), 431–441, appendix; good to half a minute of arc
//! from 1999 to 2015. In f64 all through: Mitsuba computes it in f32, where the
//! days since 2000 leave the hour uncertain by minutes.

use std::f64::consts::{FRAC_PI_2, TAU};

/// Somebody at a place and a time. The default is what Mitsuba takes: Tokyo,
/// 10 July 2010, three in the afternoon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Degrees, north positive.
    pub latitude: f64,
    /// Degrees, east positive.
    pub longitude: f64,
    /// Hours that the clock is ahead of UT.
    pub timezone: f64,
    /// Year, Gregorian.
    pub year: i64,
    /// Month, from 1.
    pub month: i64,
    /// Day, from 1.
    pub day: i64,
    /// Hour, minute and second on the clock; fractions allowed.
    pub clock: [f64; 3],
}

/// Years, months and days that make a date.
pub const DATE_PARTS: std::ops::RangeInclusive<i64> = -4000..=40_000;

impl Default for Observer {
    fn default() -> Self {
        Observer {
            latitude: 35.6894,
            longitude: 139.6917,
            timezone: 9.0,
            year: 2010,
            month: 7,
            day: 10,
            clock: [15.0, 0.0, 0.0],
        }
    }
}

/// A direction in the sky, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// From straight up.
    pub zenith: f64,
    /// From north over east.
    pub azimuth: f64,
}

/// Mean radius of the earth over its mean distance from the sun.
const PARALLAX: f64 = 6371.01 / 149_597_890.0;

impl Observer {
    /// Where this observer sees the sun, below the horizon too.
    #[must_use]
    pub fn sun(&self) -> SunPosition {
        let [hour, minute, second] = self.clock;
        let universal = hour - self.timezone + (minute + second / 60.0) / 60.0;
        // Days since noon of 1 January 2000, UT.
        let days = self.julian_day() - 2_451_545.5 + universal / 24.0;

        // On the ecliptic.
        let omega = 2.1429 - 0.001_039_459_4 * days;
        let mean_longitude = 4.895_063_0 + 0.017_202_791_698 * days;
        let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
        let longitude = mean_longitude + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
            - 0.000_113_4
            - 0.000_020_3 * omega.sin();
        let obliquity = 0.409_092_8 - 6.2140e-9 * days + 0.000_039_6 * omega.cos();

        // On the celestial sphere.
        let right_ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos()).rem_euclid(TAU);
        let (sin_declination, cos_declination) = {
            let sin = obliquity.sin() * longitude.sin();
            (sin, (1.0 - sin * sin).sqrt())
        };

        // Over the observer's horizon.
        let sidereal = 6.697_424_324_2 + 0.065_709_828_3 * days + universal;
        let hour_angle = (sidereal * 15.0 + self.longitude).to_radians() - right_ascension;
        let (sin_latitude, cos_latitude) = self.latitude.to_radians().sin_cos();
        let up = cos_latitude * hour_angle.cos() * cos_declination + sin_declination * sin_latitude;
        let east = -hour_angle.sin() * cos_declination;
        let north = sin_declination * cos_latitude - sin_latitude * hour_angle.cos() * cos_declination;
        let zenith = FRAC_PI_2 - up.atan2(east.hypot(north));
        SunPosition { zenith: zenith + PARALLAX * zenith.sin(), azimuth: east.atan2(north).rem_euclid(TAU) }
    }

    /// The Julian day number of noon (Fliegel and Van Flandern 1968).
    fn julian_day(&self) -> f64 {
        let Observer { year, month, day, .. } = *self;
        let shift = (month - 14) / 12;
        let number = (1461 * (year + 4800 + shift)) / 4 + (367 * (month - 2 - 12 * shift)) / 12
            - (3 * ((year + 4900 + shift) / 100)) / 4
            + day
            - 32_075;
        number as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the solstices and the equinox the sun culminates where geometry
    /// puts it: due south, at latitude minus declination.
    #[test]
    fn culminations() {
        for (month, day, declination) in [(6, 21, 23.43), (12, 21, -23.43), (3, 20, 0.0)] {
            let greenwich = Observer {
                latitude: 51.48,
                longitude: 0.0,
                timezone: 0.0,
                month,
                day,
                ..Observer::default()
            };
            let noons = (0..600).map(|i| Observer { clock: [11.5, f64::from(i) / 10.0, 0.0], ..greenwich });
            let highest = noons.map(|o| o.sun()).min_by(|a, b| a.zenith.total_cmp(&b.zenith)).unwrap();
            let off = highest.zenith.to_degrees() - (51.48 - declination);
            assert!(off.abs() < 0.25, "{month}: {off}");
            assert!((highest.azimuth.to_degrees() - 180.0).abs() < 0.2, "{month}");
        }
    }

    /// Mitsuba 3.9.1 has it there, to what its f32 can hold: x is the south, y
    /// the west.
    #[test]
    fn agrees_with_mitsuba_391() {
        let tokyo = Observer::default();
        let london = Observer {
            latitude: 51.5,
            longitude: 0.0,
            timezone: 0.0,
            month: 3,
            day: 20,
            clock: [9.0, 0.0, 0.0],
            ..tokyo
        };
        let cape = Observer {
            latitude: -33.9,
            longitude: 18.4,
            timezone: 2.0,
            year: 2005,
            month: 1,
            day: 5,
            clock: [12.0, 30.0, 0.0],
        };
        for (observer, expected) in [
            (tokyo, [0.0513854, 0.691748, 0.720308]),
            (london, [0.535976, -0.729895, 0.424243]),
            (cape, [-0.194147, -0.0880579, 0.977012]),
        ] {
            let SunPosition { zenith, azimuth } = observer.sun();
            let found = [-azimuth.cos() * zenith.sin(), -azimuth.sin() * zenith.sin(), zenith.cos()];
            let off = found.iter().zip(expected).map(|(f, e)| (f - e) * (f - e)).sum::<f64>().sqrt();
            assert!(off.to_degrees() < 0.3, "{observer:?}: {found:?}, {} degrees off", off.to_degrees());
        }
    }
}

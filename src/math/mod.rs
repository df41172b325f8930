//! Frames, bounds, rays, transforms and error-bounded arithmetic.
//!
//! Everything here is plain f32 for kernels and f64 for set-up; nothing is
//! generic over the float type.

mod bounds;
mod error;
mod frame;
mod motion;
mod ray;
mod transform;

pub use bounds::Bounds;
pub use error::{
    MACHINE_EPSILON, angle_between, difference_of_products, gamma, next_down, next_up, offset_origin,
    solve_quadratic,
};
pub use frame::Frame;
pub use motion::{Affine, Motion};
pub use ray::Ray;
pub use transform::{Decomposition, Transform};

pub use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Mat2, Vec2, Vec3, Vec4};

/// Scene-linear RGB (radiance, reflectance or weight, as the name says).
pub type Rgb = Vec3;

/// Largest f32 below one: the upper end of every uniform number.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

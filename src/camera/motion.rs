//! A camera that moves while the shutter is open.

use super::parse;
use crate::desc::{ObjectId, Result, SceneDesc};
use crate::math::{DVec3, Motion, Ray, Transform};

/// Carries the rays of a camera as it stood when the shutter opened to where
/// it is later.
#[derive(Clone, Debug)]
pub struct CameraMotion {
    /// Camera to the recentred world, over the shutter, [0, 1].
    motion: Motion,
    /// The recentred world to the camera when the shutter opened.
    back: Transform,
}

impl CameraMotion {
    /// The motion of a `<sensor>`; `None` when it stands still.
    pub fn from_desc(scene: &SceneDesc, id: ObjectId, recentre: DVec3) -> Result<Option<CameraMotion>> {
        let motion = parse::motion(scene, id)?;
        if motion.as_still().is_some() {
            return Ok(None);
        }
        let motion = motion.map(|m| Transform::translate(-recentre).after(m));
        Ok(Some(CameraMotion { back: motion.at(0.0).inverted(), motion }))
    }

    /// Where the camera sees, at the opening of the shutter, what it sees at
    /// `p` at a time.
    #[must_use]
    pub fn to_opening(&self, p: DVec3, time: f32) -> DVec3 {
        self.motion.at(f64::from(time)).after(&self.back).inverted().point(p)
    }

    /// The ray of the camera at the ray's own time.
    #[must_use]
    pub fn carry(&self, ray: &Ray) -> Ray {
        let now = self.motion.at(f64::from(ray.time)).after(&self.back);
        let dir = now.vector(ray.dir.as_dvec3());
        Ray { origin: now.point_f32(ray.origin), dir: dir.normalize().as_vec3(), ..*ray }
    }
}

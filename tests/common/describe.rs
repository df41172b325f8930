//! Builds scene descriptions by hand, without a scene file.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::sync::Arc;

use etendue::desc::{Category, Image, Object, ObjectId, Param, Pixels, Pos, SceneDesc, Value};
use etendue::math::{DMat4, DVec3, Transform};

/// A description under construction; object n stands on line n + 1.
pub struct Describe {
    pub scene: SceneDesc,
}

impl Describe {
    pub fn new() -> Describe {
        Describe { scene: SceneDesc { files: vec!["scene.xml".to_string()], ..SceneDesc::default() } }
    }

    /// Adds an object; parameter k stands in column k + 2 of its line.
    pub fn object(&mut self, category: Category, plugin: &str, params: Vec<(&str, Value)>) -> ObjectId {
        let line = self.scene.objects.len() as u32 + 1;
        let at = |column: usize| Pos { file: 0, line, column: column as u32 };
        let params = params
            .into_iter()
            .enumerate()
            .map(|(k, (name, value))| Param { name: name.to_string(), value, pos: at(k + 2) })
            .collect();
        let (plugin, id) = (plugin.to_string(), String::new());
        self.scene.objects.push(Object { category, plugin, id, pos: at(1), params });
        line - 1
    }

    /// Adds a float image of `channels` interleaved channels.
    pub fn image(&mut self, size: [u32; 2], channels: u32, pixels: Pixels) -> Value {
        let [width, height] = size;
        let name = "map.exr".to_string();
        self.scene.images.push(Arc::new(Image { width, height, channels, pixels, name }));
        Value::Image(self.scene.images.len() as u32 - 1)
    }
}

pub fn float(v: f64) -> Value {
    Value::Float(v)
}

pub fn string(v: &str) -> Value {
    Value::String(v.to_string())
}

pub fn vector(x: f64, y: f64, z: f64) -> Value {
    Value::Vector(DVec3::new(x, y, z))
}

pub fn transform(matrix: DMat4) -> Value {
    Value::Transform(Transform::from_matrix(matrix).expect("an invertible matrix"))
}

/// Mitsuba's `look_at`: z towards the target, x = up × z, y = z × x.
pub fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> DMat4 {
    let z = (target - origin).normalize();
    let x = up.cross(z).normalize();
    let y = z.cross(x);
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), origin.extend(1.0))
}

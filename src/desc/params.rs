//! Reads an object's parameters and remembers which names were asked for, so
//! that a parameter nobody knows is an error with the nearest known name.

use std::cell::RefCell;

use super::{Category, Error, Object, ObjectId, Param, Pos, Result, SceneDesc, Value};
use crate::math::{DVec3, Motion, Rgb, Transform};

/// The parameters of one object. Call [`Params::finish`] when all are read.
#[derive(Debug)]
pub struct Params<'a> {
    scene: &'a SceneDesc,
    object: &'a Object,
    used: RefCell<Vec<bool>>,
    known: RefCell<Vec<&'static str>>,
}

impl<'a> Params<'a> {
    /// A reader of one object's parameters.
    #[must_use]
    pub fn new(scene: &'a SceneDesc, id: ObjectId) -> Params<'a> {
        let object = scene.object(id);
        Params {
            scene,
            object,
            used: RefCell::new(vec![false; object.params.len()]),
            known: RefCell::new(Vec::new()),
        }
    }

    /// The object itself.
    #[must_use]
    pub fn object(&self) -> &'a Object {
        self.object
    }

    /// The scene it belongs to.
    #[must_use]
    pub fn scene(&self) -> &'a SceneDesc {
        self.scene
    }

    /// An error at the object's tag.
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.scene.error(self.object.pos, message)
    }

    /// An error at a parameter of the object (at its tag if it has no such parameter).
    pub fn error_at(&self, name: &str, message: impl Into<String>) -> Error {
        self.scene.error(self.position(name), message)
    }

    /// Where a parameter stands; the object's own place if it is absent.
    #[must_use]
    pub fn position(&self, name: &str) -> Pos {
        self.object.params.iter().find(|p| p.name == name).map_or(self.object.pos, |p| p.pos)
    }

    /// The raw parameter of a name, marked as read.
    pub fn get(&self, name: &'static str) -> Option<&'a Param> {
        self.known.borrow_mut().push(name);
        let index = self.object.params.iter().position(|p| p.name == name)?;
        self.used.borrow_mut()[index] = true;
        Some(&self.object.params[index])
    }

    /// True if the parameter is given.
    pub fn has(&self, name: &'static str) -> bool {
        self.known.borrow_mut().push(name);
        self.object.params.iter().any(|p| p.name == name)
    }

    fn wrong_type(&self, param: &Param, expected: &str) -> Error {
        self.scene.error(
            param.pos,
            format!("`{}` must be {expected}, found {}", param.name, with_article(param.value.type_name())),
        )
    }

    /// A float (an integer is accepted), or the default. Always finite.
    pub fn float(&self, name: &'static str, default: f64) -> Result<f64> {
        Ok(self.float_opt(name)?.unwrap_or(default))
    }

    /// A float if given. Always finite.
    pub fn float_opt(&self, name: &'static str) -> Result<Option<f64>> {
        let Some(param) = self.get(name) else { return Ok(None) };
        match param.value {
            Value::Float(v) => Ok(Some(v)),
            Value::Int(v) => Ok(Some(v as f64)),
            _ => Err(self.wrong_type(param, "a float")),
        }
    }

    /// An integer, or the default.
    pub fn int(&self, name: &'static str, default: i64) -> Result<i64> {
        Ok(self.int_opt(name)?.unwrap_or(default))
    }

    /// An integer if given.
    pub fn int_opt(&self, name: &'static str) -> Result<Option<i64>> {
        let Some(param) = self.get(name) else { return Ok(None) };
        match param.value {
            Value::Int(v) => Ok(Some(v)),
            Value::Float(v) if v.fract() == 0.0 && v.abs() < 1e15 => {
                let outcome = format!("replaced by {v}");
                self.scene.replace(self.wrong_type(param, "an integer"), &outcome)?;
                Ok(Some(v as i64))
            }
            _ => Err(self.wrong_type(param, "an integer")),
        }
    }

    /// A boolean, or the default.
    pub fn bool(&self, name: &'static str, default: bool) -> Result<bool> {
        let Some(param) = self.get(name) else { return Ok(default) };
        match param.value {
            Value::Bool(v) => Ok(v),
            _ => Err(self.wrong_type(param, "a boolean")),
        }
    }

    /// A string if given.
    pub fn string_opt(&self, name: &'static str) -> Result<Option<&'a str>> {
        let Some(param) = self.get(name) else { return Ok(None) };
        match &param.value {
            Value::String(v) => Ok(Some(v)),
            _ => Err(self.wrong_type(param, "a string")),
        }
    }

    /// One of several words, or the default.
    pub fn choice(
        &self,
        name: &'static str,
        known: &[&'static str],
        default: &'static str,
    ) -> Result<&'static str> {
        let Some(word) = self.string_opt(name)? else { return Ok(default) };
        if let Some(found) = known.iter().copied().find(|k| *k == word) {
            return Ok(found);
        }
        let error = self
            .error_at(name, format!("`{name}` has no value `{word}`"))
            .suggest(word, known.iter().copied());
        self.scene.replace(error, &format!("replaced by `{default}`"))?;
        Ok(default)
    }

    /// A point or vector if given.
    pub fn vector_opt(&self, name: &'static str) -> Result<Option<DVec3>> {
        let Some(param) = self.get(name) else { return Ok(None) };
        match param.value {
            Value::Vector(v) => Ok(Some(v)),
            _ => Err(self.wrong_type(param, "a point or vector")),
        }
    }

    /// A transform, or the identity.
    pub fn transform(&self, name: &'static str) -> Result<Transform> {
        let Some(param) = self.get(name) else { return Ok(Transform::IDENTITY) };
        match param.value {
            Value::Transform(v) => Ok(v),
            Value::Motion(ref v) => match v.as_still() {
                Some(transform) => Ok(transform),
                None => Err(self
                    .scene
                    .error(
                        param.pos,
                        format!("{} `{}` cannot move", self.object.category.tag(), self.object.plugin),
                    )
                    .hint("shapes, instances, sensors and emitters `point`, `spot`, `directional` can")),
            },
            _ => Err(self.wrong_type(param, "a transform")),
        }
    }

    /// A transform that may move, or the identity.
    pub fn motion(&self, name: &'static str) -> Result<Motion> {
        let Some(param) = self.get(name) else { return Ok(Motion::still(Transform::IDENTITY)) };
        match &param.value {
            Value::Transform(v) => Ok(Motion::still(*v)),
            Value::Motion(v) => Ok(v.clone()),
            _ => Err(self.wrong_type(param, "a transform or an animation")),
        }
    }

    /// The horizontal field of view in degrees of a film of this aspect, from
    /// `fov` and `fov_axis` or `focal_length`.
    pub fn x_fov_deg(&self, aspect: f64) -> Result<f64> {
        super::optics::x_fov_deg(self, aspect)
    }

    /// A plain colour (rgb or a single float), or the default. No texture.
    pub fn rgb(&self, name: &'static str, default: Rgb) -> Result<Rgb> {
        let Some(param) = self.get(name) else { return Ok(default) };
        match param.value {
            Value::Rgb(c) => Ok(DVec3::from(c).as_vec3()),
            Value::Float(v) => Ok(Rgb::splat(v as f32)),
            Value::Int(v) => Ok(Rgb::splat(v as f32)),
            _ => Err(self.wrong_type(param, "an rgb colour")),
        }
    }

    /// All child objects of a category, marked as read: (parameter name, id).
    pub fn children(&self, category: Category) -> Vec<(&'a str, ObjectId)> {
        let mut out = Vec::new();
        for (i, param) in self.object.params.iter().enumerate() {
            if let Value::Object(id) = param.value
                && self.scene.object(id).category == category
            {
                self.used.borrow_mut()[i] = true;
                out.push((param.name.as_str(), id));
            }
        }
        out
    }

    /// The mesh that the reader attached under the name `mesh`.
    pub fn mesh(&self) -> Option<&'a std::sync::Arc<super::Mesh>> {
        match self.get("mesh")?.value {
            Value::Mesh(i) => self.scene.meshes.get(i as usize),
            _ => None,
        }
    }

    /// The image that the reader attached under the name `image`.
    pub fn image(&self) -> Option<&'a std::sync::Arc<super::Image>> {
        match self.get("image")?.value {
            Value::Image(i) => self.scene.images.get(i as usize),
            _ => None,
        }
    }

    /// The curves that the reader attached under the name `curves`.
    pub fn curves(&self) -> Option<&'a std::sync::Arc<super::Curves>> {
        match self.get("curves")?.value {
            Value::Curves(i) => self.scene.curves.get(i as usize),
            _ => None,
        }
    }

    /// The measurement that the reader attached under the name `measured`.
    pub fn measured(&self) -> Option<&'a std::sync::Arc<super::MeasuredData>> {
        match self.get("measured")?.value {
            Value::Measured(i) => self.scene.measured.get(i as usize),
            _ => None,
        }
    }

    /// Fails on the first parameter that was not read; in a lenient scene all
    /// of them are ignored.
    pub fn finish(self) -> Result<()> {
        let used = self.used.borrow();
        for (param, _) in self.object.params.iter().zip(used.iter()).filter(|(_, used)| !**used) {
            self.scene.replace(self.not_taken(param), "ignored")?;
        }
        Ok(())
    }

    /// The error of a parameter that nobody reads.
    fn not_taken(&self, param: &Param) -> Error {
        let owner = format!("{} `{}`", self.object.category.tag(), self.object.plugin);
        let message = match param.value {
            Value::Object(id) => {
                let child = self.scene.object(id).category.tag();
                if param.name.is_empty() {
                    return self.scene.error(param.pos, format!("{owner} takes no {child}"));
                }
                format!("{owner} takes no parameter `{}` ({})", param.name, with_article(child))
            }
            _ => format!("{owner} takes no parameter `{}`", param.name),
        };
        self.scene.error(param.pos, message).suggest(&param.name, self.known.borrow().iter().copied())
    }
}

fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {noun}")
}

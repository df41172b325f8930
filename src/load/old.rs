//! An object of an old file while it is turned into one of today's.

use crate::desc::{Category, Object, ObjectId, Param, Pos, Result, SceneDesc, Value};

/// One object of a scene, to be changed in place: what refers to it stays.
pub struct Old<'a> {
    /// The scene.
    pub scene: &'a mut SceneDesc,
    /// The object.
    pub id: ObjectId,
}

impl Old<'_> {
    fn object(&self) -> &Object {
        &self.scene.objects[self.id as usize]
    }

    fn object_mut(&mut self) -> &mut Object {
        &mut self.scene.objects[self.id as usize]
    }

    /// What it is for.
    pub fn category(&self) -> Category {
        self.object().category
    }

    /// Its plugin.
    pub fn plugin(&self) -> String {
        self.object().plugin.clone()
    }

    /// Makes it another plugin.
    pub fn become_plugin(&mut self, plugin: &str) {
        self.object_mut().plugin = plugin.into();
    }

    /// Where it stands.
    pub fn pos(&self) -> Pos {
        self.object().pos
    }

    /// A parameter, which stays.
    pub fn get(&self, name: &str) -> Option<&Param> {
        self.object().params.iter().find(|p| p.name == name)
    }

    /// True if it has the parameter.
    pub fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    /// Takes a parameter out.
    pub fn take(&mut self, name: &str) -> Option<Param> {
        let params = &mut self.object_mut().params;
        let index = params.iter().position(|p| p.name == name)?;
        Some(params.remove(index))
    }

    /// A number, which is taken out; anything else stays where it is.
    pub fn take_number(&mut self, name: &str) -> Option<f64> {
        let value = number(&self.get(name)?.value)?;
        self.take(name);
        Some(value)
    }

    /// A word, if it is one; it stays.
    pub fn word(&self, name: &str) -> Option<&str> {
        match &self.get(name)?.value {
            Value::String(word) => Some(word),
            _ => None,
        }
    }

    /// True or false, if given; it is taken out.
    pub fn take_bool(&mut self, name: &str) -> Option<bool> {
        let Value::Bool(value) = self.get(name)?.value else { return None };
        self.take(name);
        Some(value)
    }

    /// Takes parameters out that change nothing here.
    pub fn forget(&mut self, names: &[&str]) {
        self.object_mut().params.retain(|p| !names.contains(&p.name.as_str()));
    }

    /// Keeps only parameters of these names.
    pub fn keep(&mut self, names: &[&str]) {
        self.object_mut().params.retain(|p| names.contains(&p.name.as_str()));
    }

    /// Gives a parameter another name.
    pub fn rename(&mut self, from: &str, to: &str) {
        if let Some(param) = self.object_mut().params.iter_mut().find(|p| p.name == from) {
            param.name = to.into();
        }
    }

    /// Sets a parameter, in the place of what had the name before.
    pub fn set(&mut self, name: &str, value: Value) {
        let pos = self.get(name).map_or(self.pos(), |p| p.pos);
        self.take(name);
        self.object_mut().params.push(Param { name: name.into(), value, pos });
    }

    /// Adds a nested object without a name.
    pub fn nest(&mut self, child: ObjectId) {
        let pos = self.pos();
        self.object_mut().params.push(Param { name: String::new(), value: Value::Object(child), pos });
    }

    /// Nested objects of a category, which are taken out.
    pub fn take_children(&mut self, category: Category) -> Vec<ObjectId> {
        let children = self.children(category);
        self.object_mut().params.retain(|p| !matches!(p.value, Value::Object(id) if children.contains(&id)));
        children
    }

    /// Nested objects of a category.
    pub fn children(&self, category: Category) -> Vec<ObjectId> {
        let child = |p: &Param| match p.value {
            Value::Object(id) if self.scene.object(id).category == category => Some(id),
            _ => None,
        };
        self.object().params.iter().filter_map(child).collect()
    }

    /// A new object at the same place of the file.
    pub fn add(&mut self, category: Category, plugin: &str, params: Vec<(&str, Value)>) -> ObjectId {
        let pos = self.pos();
        let params =
            params.into_iter().map(|(name, value)| Param { name: name.into(), value, pos }).collect();
        self.scene.objects.push(Object { category, plugin: plugin.into(), id: String::new(), pos, params });
        self.scene.objects.len() as ObjectId - 1
    }

    /// An error at the object: `message`; with `--lenient` a note instead.
    pub fn replace(&self, message: impl Into<String>, outcome: &str) -> Result<()> {
        self.replace_at(self.pos(), message, outcome)
    }

    /// The same at a parameter.
    pub fn replace_at(&self, pos: Pos, message: impl Into<String>, outcome: &str) -> Result<()> {
        let error = self.scene.error(pos, message).hint(format!("with --lenient it is {outcome}"));
        self.scene.replace(error, outcome)
    }

    /// A warning at the object.
    pub fn warn(&mut self, message: &str) {
        let pos = self.pos();
        let file = &self.scene.files[pos.file as usize];
        let text = format!("{file}:{}:{}: {message}", pos.line, pos.column);
        self.scene.warnings.push(text);
    }
}

/// The value as a number.
pub fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(v) => Some(*v),
        Value::Int(v) => Some(*v as f64),
        _ => None,
    }
}

/// The value as a colour, if it is one of numbers.
pub fn colour(value: &Value) -> Option<[f64; 3]> {
    match value {
        Value::Rgb(c) => Some(*c),
        Value::Spectrum(pairs) => {
            Some(crate::color::reflectance_spectrum_to_rgb(pairs).as_dvec3().to_array())
        }
        other => number(other).map(|v| [v; 3]),
    }
}

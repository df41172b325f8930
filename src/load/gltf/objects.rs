//! The scene description under construction. Every object of a glTF file has a
//! place in its JSON instead of a line; such places stand in the list of files,
//! so that messages read `scene.glb: materials[3]: …`.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use crate::desc::{Category, Image, Mesh, Object, ObjectId, Param, Pos, SceneDesc, Value};

/// Objects, meshes and images so far.
#[derive(Debug)]
pub struct Objects {
    /// What they make up.
    pub desc: SceneDesc,
    places: HashMap<String, u32>,
    /// Warnings so far.
    warned: HashSet<String>,
}

impl Objects {
    /// Only the scene object.
    pub fn new(file: &str) -> Objects {
        let mut objects =
            Objects { desc: SceneDesc::default(), places: HashMap::new(), warned: HashSet::new() };
        objects.desc.files.push(file.to_string());
        objects.desc.root = objects.add(Category::Scene, "scene", Pos::default(), Vec::new());
        objects
    }

    /// The position that stands for a place in the JSON.
    pub fn pos(&mut self, place: &str) -> Pos {
        let next = self.desc.files.len() as u32;
        let file = *self.places.entry(place.to_string()).or_insert(next);
        if file == next {
            let full = format!("{}: {place}", self.desc.files[0]);
            self.desc.files.push(full);
        }
        Pos { file, line: 0, column: 0 }
    }

    /// A new object.
    pub fn add(
        &mut self,
        category: Category,
        plugin: &str,
        pos: Pos,
        params: Vec<(&str, Value)>,
    ) -> ObjectId {
        let params =
            params.into_iter().map(|(name, value)| Param { name: name.into(), value, pos }).collect();
        self.desc.objects.push(Object { category, plugin: plugin.into(), id: String::new(), pos, params });
        self.desc.objects.len() as ObjectId - 1
    }

    /// Gives an object its id.
    pub fn name(&mut self, object: ObjectId, id: String) {
        self.desc.objects[object as usize].id = id;
    }

    /// Makes an object a child of the scene.
    pub fn show(&mut self, child: ObjectId) {
        let pos = self.desc.object(child).pos;
        let root = self.desc.root as usize;
        let param = Param { name: String::new(), value: Value::Object(child), pos };
        self.desc.objects[root].params.push(param);
    }

    /// A new image.
    pub fn image(&mut self, image: Arc<Image>) -> u32 {
        self.desc.images.push(image);
        self.desc.images.len() as u32 - 1
    }

    /// A new mesh.
    pub fn mesh(&mut self, mesh: Arc<Mesh>) -> u32 {
        self.desc.meshes.push(mesh);
        self.desc.meshes.len() as u32 - 1
    }

    /// Something the user should know, once.
    pub fn warn(&mut self, place: &str, message: &str) {
        let warning = format!("{}: {place}: {message}", self.desc.files[0]);
        if self.warned.insert(warning.clone()) {
            self.desc.warnings.push(warning);
        }
    }
}

//! Walks the XML of a scene and its includes, and makes objects of it.
//!
//! References stay pending until everything is read: an id may be used before
//! it is declared.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::substitute::Parameters;
use super::transform;
use super::values;
use super::xml::{Source, Tag};
use super::{LoadOptions, files};
use crate::desc::{Category, Error, Leniency, Object, ObjectId, Param, Pos, Result, SceneDesc, Value};
use crate::math::{Motion, Transform};

/// Includes within includes; Mitsuba 3 has the same limit.
const INCLUDE_DEPTH: usize = 15;
/// Files read for one scene, and their bytes together.
const INCLUDE_COUNT: usize = 10_000;
const TOTAL_BYTES: usize = 1 << 30;
/// Tags within tags.
const NESTING: usize = 100;
/// Parameters of an object that are looked through one by one.
const CROWD: usize = 64;

/// Tags that hold an object.
const OBJECT_TAGS: &[Category] = &[
    Category::Scene,
    Category::Shape,
    Category::Bsdf,
    Category::Texture,
    Category::Emitter,
    Category::Sensor,
    Category::Film,
    Category::Rfilter,
    Category::Sampler,
    Category::Integrator,
    Category::Medium,
    Category::Phase,
    Category::Volume,
];

/// The file to start from.
pub struct Root<'a> {
    /// As the user would name it.
    pub name: String,
    /// Where it is, unless it came as a string.
    pub path: Option<&'a Path>,
    /// Its text.
    pub text: &'a str,
    /// Where its relative names start.
    pub dir: PathBuf,
}

/// A `<ref>` not yet resolved.
pub struct Pending {
    /// The object it stands in.
    pub owner: ObjectId,
    /// Which of the owner's parameters it is.
    pub param: usize,
    /// The id it names.
    pub id: String,
}

/// A version as written, `major.minor.patch`.
pub type Version = [u32; 3];
/// The first version whose spellings are today's.
pub const MITSUBA_2: Version = [2, 0, 0];

/// What reading the XML gives.
#[derive(Default)]
pub struct Parsed {
    /// Objects with pending references (their value is `Object(ObjectId::MAX)`).
    pub scene: SceneDesc,
    /// Pending references.
    pub pending: Vec<Pending>,
    /// Objects by id and alias.
    pub ids: HashMap<String, ObjectId>,
    /// Per file: where its relative names are looked for.
    pub search: Vec<Vec<PathBuf>>,
    /// Per file: its version.
    pub versions: Vec<Version>,
}

/// Reads the XML of a scene.
pub fn parse_scene(root: Root, options: &LoadOptions) -> Result<Parsed> {
    let leniency = if options.lenient { Leniency::lenient() } else { Leniency::default() };
    let mut parser = Parser {
        out: Parsed { scene: SceneDesc { leniency, ..SceneDesc::default() }, ..Parsed::default() },
        parameters: Parameters::new(&options.defines)?,
        stack: root.path.map(files::canonical).into_iter().collect(),
        bytes: 0,
        crowds: HashMap::new(),
    };
    let name = root.name.clone();
    parser.file(root.name, root.text, vec![root.dir], Attach::Root)?;
    parser.parameters.check_used().map_err(|e| e.at(name, Pos::default()))?;
    Ok(parser.out)
}

/// What the root tag of a file becomes.
#[derive(Clone, Copy)]
enum Attach<'a> {
    /// The scene.
    Root,
    /// Children of an object, under a name if one is given.
    Include { owner: ObjectId, name: Option<&'a str>, depth: usize },
}

/// Where a tag stands.
#[derive(Clone, Copy)]
struct Place {
    owner: ObjectId,
    depth: usize,
    /// Directly under the root tag of its file.
    top: bool,
}

struct Parser {
    out: Parsed,
    parameters: Parameters,
    /// Canonical paths of the files being read, outermost first.
    stack: Vec<PathBuf>,
    bytes: usize,
    /// Lines of the named parameters of objects that have many.
    crowds: HashMap<ObjectId, HashMap<String, u32>>,
}

impl Parser {
    fn file(&mut self, name: String, text: &str, search: Vec<PathBuf>, attach: Attach) -> Result<()> {
        let source = Source::new(self.out.scene.files.len() as u32, name.clone(), text);
        self.out.scene.files.push(name);
        self.out.search.push(search);
        self.bytes += text.len();
        if self.out.scene.files.len() > INCLUDE_COUNT || self.bytes > TOTAL_BYTES {
            return Err(source.error(0, "the scene includes too many files"));
        }
        let document = source.document()?;
        let root = document.root_element();
        let tag = Tag::new(&source, root, &mut self.parameters)?;
        let version = match version(&tag) {
            Ok(version) => version,
            Err(error) => {
                self.out.scene.replace(error, "read as version 0.6.0")?;
                [0, 6, 0]
            }
        };
        self.out.versions.push(version);
        match attach {
            Attach::Root => {
                if tag.name != "scene" {
                    return Err(tag
                        .error(format!("the file must start with `<scene>`, found `<{}>`", tag.name))
                        .suggest(tag.name, ["scene"]));
                }
                self.object(root, &tag, Category::Scene, None)
            }
            Attach::Include { owner, depth, .. } if tag.name == "scene" => {
                tag.only(&["version", "type", "id", "name"])?;
                self.children(&source, root, Place { owner, depth: depth + 1, top: true })
            }
            Attach::Include { owner, name, depth } => {
                let Some(category) = category(tag.name) else { return Err(unknown_tag(&tag)) };
                let own = tag.get("name").map(|a| a.value.as_str());
                let name = name.or(own).unwrap_or_default();
                self.object(root, &tag, category, Some((Place { owner, depth, top: false }, name)))
            }
        }
    }

    fn children(&mut self, source: &Source, node: Node, place: Place) -> Result<()> {
        for child in node.children() {
            if child.is_element() {
                self.element(source, child, place)?;
            } else if child.is_text() && child.text().is_some_and(|t| !t.trim().is_empty()) {
                let pos = source.pos(child.range().start);
                self.out.scene.warnings.push(format!(
                    "{}:{}:{}: text between tags has no meaning",
                    source.name, pos.line, pos.column
                ));
            }
        }
        Ok(())
    }

    fn element(&mut self, source: &Source, node: Node, place: Place) -> Result<()> {
        let tag = Tag::new(source, node, &mut self.parameters)?;
        if place.depth > NESTING {
            return Err(tag.error(format!("tags are nested more than {NESTING} deep")));
        }
        let as_object = if tag.name == "spectrum" && tag.get("type").is_some() {
            Some(Category::Texture)
        } else {
            category(tag.name)
        };
        if let Some(category) = as_object {
            let name = tag.get("name").map(|a| a.value.clone()).unwrap_or_default();
            return self.object(node, &tag, category, Some((place, &name)));
        }
        if tag.name == "transform" {
            tag.only(&["name"])?;
            let composed = self.transform(source, node, &tag)?;
            return self.push(&tag, place.owner, parameter_name(&tag)?, Value::Transform(composed));
        }
        if tag.name == "animation" {
            return self.animation(source, node, &tag, place.owner);
        }
        if is_unknown(&tag, self.is_old(source)) {
            return self.out.scene.replace(unknown_tag(&tag), "left out");
        }
        if let Some(child) = node.children().find(Node::is_element) {
            let child = Tag::new(source, child, &mut self.parameters)?;
            return Err(child.error(format!("`<{}>` cannot stand inside `<{}>`", child.name, tag.name)));
        }
        match tag.name {
            "include" => self.include(&tag, place),
            "ref" => self.reference(&tag, place.owner),
            "default" => self.default(&tag),
            "alias" => self.alias(&tag),
            "path" => self.resource_dir(&tag, place.top),
            _ => {
                let dirs = &self.out.search[source.file as usize];
                let value = values::value(&tag, values::Reading { dirs, old: self.is_old(source) })?;
                let name = parameter_name(&tag)?;
                self.push(&tag, place.owner, name, value)
            }
        }
    }

    /// True where the spellings of Mitsuba 0.x are read.
    fn is_old(&self, source: &Source) -> bool {
        self.out.scene.leniency.is_lenient() || self.out.versions[source.file as usize] < MITSUBA_2
    }

    /// An object and all inside it. Without a place it is the scene.
    fn object(
        &mut self,
        node: Node,
        tag: &Tag,
        category: Category,
        place: Option<(Place, &str)>,
    ) -> Result<()> {
        let is_file_root = node.parent_element().is_none();
        if is_file_root {
            tag.only(&["version", "type", "id", "name"])?;
        } else {
            tag.only(&["type", "id", "name"])?;
        }
        let plugin = match tag.get("type") {
            Some(a) if !a.value.is_empty() => a.value.clone(),
            Some(a) => return Err(tag.error_in(a, format!("`<{}>` has an empty `type`", tag.name))),
            None if category == Category::Scene && is_file_root => "scene".into(),
            None => tag.need("type")?.value.clone(),
        };
        let id = tag.get("id").map(|a| a.value.clone()).unwrap_or_default();
        let object = self.out.scene.objects.len() as ObjectId;
        if let (false, Some(attribute)) = (id.is_empty(), tag.get("id")) {
            self.claim_id(&id, object).map_err(|e| self.place(e, tag, attribute.value_at))?;
        }
        if let Some((place, name)) = place {
            self.push(tag, place.owner, name.to_string(), Value::Object(object))?;
        }
        self.out.scene.objects.push(Object { category, plugin, id, pos: tag.pos(), params: Vec::new() });
        let depth = place.map_or(0, |(p, _)| p.depth) + 1;
        self.children(tag.source, node, Place { owner: object, depth, top: is_file_root })
    }

    fn place(&self, error: Error, tag: &Tag, offset: usize) -> Error {
        error.at(tag.source.name.clone(), tag.source.pos(offset))
    }

    fn claim_id(&mut self, id: &str, object: ObjectId) -> Result<()> {
        if let Some(earlier) = self.out.ids.insert(id.to_string(), object) {
            let scene = &self.out.scene;
            let Some(first) = scene.objects.get(earlier as usize) else {
                return Err(Error::new(format!("the id `{id}` is given twice")));
            };
            let file = &scene.files[first.pos.file as usize];
            return Err(Error::new(format!(
                "the id `{id}` is taken already, by `<{}>` at {file}:{}:{}",
                first.category.tag(),
                first.pos.line,
                first.pos.column
            )));
        }
        Ok(())
    }

    /// Adds a parameter to an object; a name given twice is an error.
    fn push(&mut self, tag: &Tag, owner: ObjectId, name: String, value: Value) -> Result<()> {
        let pos = tag.pos();
        if !name.is_empty()
            && let Some(line) = self.given(owner, &name, pos.line)
        {
            return Err(tag.error(format!("`{name}` is given twice, first on line {line}")));
        }
        self.out.scene.objects[owner as usize].params.push(Param { name, value, pos });
        Ok(())
    }

    /// The line that has given an object this parameter, if one has; else it is
    /// given now.
    fn given(&mut self, owner: ObjectId, name: &str, line: u32) -> Option<u32> {
        let params = &self.out.scene.objects[owner as usize].params;
        if params.len() < CROWD {
            return params.iter().find(|p| p.name == name).map(|p| p.pos.line);
        }
        let lines = self.crowds.entry(owner).or_insert_with(|| {
            params.iter().filter(|p| !p.name.is_empty()).map(|p| (p.name.clone(), p.pos.line)).collect()
        });
        if let Some(first) = lines.get(name) {
            return Some(*first);
        }
        lines.insert(name.to_owned(), line);
        None
    }

    /// Transforms with a `time` each, as Mitsuba 0.x had them.
    fn animation(&mut self, source: &Source, node: Node, tag: &Tag, owner: ObjectId) -> Result<()> {
        tag.only(&["name"])?;
        let mut keys: Vec<(f64, Transform)> = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let key = Tag::new(source, child, &mut self.parameters)?;
            if key.name != "transform" {
                return Err(key
                    .error(format!("`<{}>` cannot stand inside `<animation>`", key.name))
                    .hint("an animation is a list of `<transform time=\"…\">`"));
            }
            key.only(&["time"])?;
            let attribute = key.need("time")?;
            let time = values::scalar(&key, attribute)?;
            if keys.last().is_some_and(|(last, _)| *last >= time) {
                return Err(key.error_in(attribute, "the times of an animation must rise"));
            }
            keys.push((time, self.transform(source, child, &key)?));
        }
        let motion =
            Motion::new(&keys).ok_or_else(|| tag.error("an animation needs at least one transform"))?;
        self.push(tag, owner, parameter_name(tag)?, Value::Motion(motion))
    }

    fn transform(&mut self, source: &Source, node: Node, tag: &Tag) -> Result<Transform> {
        let mut composed = Transform::IDENTITY;
        for child in node.children().filter(Node::is_element) {
            let operation = Tag::new(source, child, &mut self.parameters)?;
            if let Some(inner) = child.children().find(Node::is_element) {
                let inner = Tag::new(source, inner, &mut self.parameters)?;
                return Err(
                    inner.error(format!("`<{}>` cannot stand inside `<{}>`", inner.name, operation.name))
                );
            }
            let old = self.is_old(source);
            composed = transform::operation(&operation, old, &mut self.out.scene.warnings)?.after(&composed);
        }
        if !(composed.matrix.is_finite() && composed.inverse.is_finite()) {
            return Err(tag.error("the transform is too extreme to be undone"));
        }
        Ok(composed)
    }

    fn reference(&mut self, tag: &Tag, owner: ObjectId) -> Result<()> {
        tag.only(&["id", "name"])?;
        let id = tag.need("id")?.value.clone();
        let name = tag.get("name").map(|a| a.value.clone()).unwrap_or_default();
        self.push(tag, owner, name, Value::Object(ObjectId::MAX))?;
        let param = self.out.scene.objects[owner as usize].params.len() - 1;
        self.out.pending.push(Pending { owner, param, id });
        Ok(())
    }

    fn default(&mut self, tag: &Tag) -> Result<()> {
        tag.only(&["name", "value"])?;
        let name = parameter_name(tag)?;
        let set = self.parameters.default(&name, &tag.need("value")?.value);
        set.map_err(|e| e.at(tag.source.name.clone(), tag.pos()))
    }

    fn alias(&mut self, tag: &Tag) -> Result<()> {
        tag.only(&["id", "as"])?;
        let (id, alias) = (tag.need("id")?, tag.need("as")?);
        let Some(object) = self.out.ids.get(&id.value).copied() else {
            let error = tag.error_in(id, format!("no object before this has the id `{}`", id.value));
            return Err(super::references::suggest_id(error, &id.value, &self.out.ids));
        };
        self.claim_id(&alias.value, object).map_err(|e| self.place(e, tag, alias.value_at))
    }

    fn resource_dir(&mut self, tag: &Tag, top: bool) -> Result<()> {
        tag.only(&["value"])?;
        if !top {
            return Err(tag.error("`<path>` can only stand directly under the root tag"));
        }
        let attribute = tag.need("value")?;
        let search = &mut self.out.search[tag.source.file as usize];
        let dir = files::find(&attribute.value, search)
            .map_err(|e| e.at(tag.source.name.clone(), tag.source.pos(attribute.value_at)))?;
        if !dir.is_dir() {
            return Err(tag.error_in(attribute, format!("`{}` is not a folder", attribute.value)));
        }
        search.insert(0, dir);
        Ok(())
    }

    fn include(&mut self, tag: &Tag, place: Place) -> Result<()> {
        tag.only(&["filename", "name"])?;
        let attribute = tag.need("filename")?;
        let at = |e: Error| e.at(tag.source.name.clone(), tag.source.pos(attribute.value_at));
        let search = self.out.search[tag.source.file as usize].clone();
        let path = files::find(&attribute.value, &search).map_err(at)?;
        let canonical = files::canonical(&path);
        if self.stack.contains(&canonical) {
            return Err(tag.error_in(attribute, format!("`{}` includes itself", path.display())));
        }
        if self.stack.len() >= INCLUDE_DEPTH {
            return Err(
                tag.error_in(attribute, format!("includes are nested more than {INCLUDE_DEPTH} deep"))
            );
        }
        let text = files::read_text(&path, files::XML_CAP).map_err(at)?;
        let mut dirs = search;
        dirs.insert(0, path.parent().unwrap_or(Path::new("")).to_path_buf());
        let name = tag.get("name").map(|a| a.value.as_str());
        let attach = Attach::Include { owner: place.owner, name, depth: place.depth };
        self.stack.push(canonical);
        self.file(path.display().to_string(), &text, dirs, attach)?;
        self.stack.pop();
        Ok(())
    }
}

/// True for a tag that is neither an object's nor any other that can stand in one.
fn is_unknown(tag: &Tag, old: bool) -> bool {
    let known = ["include", "ref", "default", "alias", "path"];
    !known.contains(&tag.name) && !values::is_value(tag.name, old)
}

fn category(tag: &str) -> Option<Category> {
    OBJECT_TAGS.iter().copied().find(|c| c.tag() == tag)
}

fn unknown_tag(tag: &Tag) -> Error {
    let others = ["transform", "animation", "include", "ref", "default", "alias", "path"];
    let known = OBJECT_TAGS.iter().map(|c| c.tag()).chain(values::VALUE_TAGS.iter().copied()).chain(others);
    if transform::OPERATIONS.contains(&tag.name) {
        return tag.error(format!("`<{}>` can only stand inside `<transform>`", tag.name));
    }
    tag.error(format!("unknown tag `<{}>`", tag.name)).suggest(tag.name, known)
}

fn parameter_name(tag: &Tag) -> Result<String> {
    let attribute = tag.need("name")?;
    if attribute.value.is_empty() {
        return Err(tag.error_in(attribute, format!("`<{}>` has an empty `name`", tag.name)));
    }
    Ok(attribute.value.clone())
}

/// The root tag's version: one to three numbers.
fn version(tag: &Tag) -> Result<Version> {
    let Some(attribute) = tag.get("version") else {
        return Err(tag
            .error(format!("the root tag `<{}>` needs a version", tag.name))
            .hint("for example `<scene version=\"3.0.0\">`"));
    };
    let mut version = [0; 3];
    let mut words = attribute.value.trim().split('.');
    let mut valid = !attribute.value.trim().is_empty();
    for (slot, word) in version.iter_mut().zip(&mut words) {
        match word.parse() {
            Ok(number) => *slot = number,
            Err(_) => valid = false,
        }
    }
    if !valid || words.next().is_some() {
        return Err(tag
            .error_in(attribute, format!("`{}` is not a version", attribute.value))
            .hint("for example `3.0.0`"));
    }
    Ok(version)
}

//! The nodes of a scene to objects: which meshes they hold, where they stand,
//! and what is shared.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::super::LoadOptions;
use super::deform::{Deformer, Skin};
use super::geometry::{self, Geometry};
use super::json::{Instancing, Material, Primitive};
use super::material::{self, Look, Materials, VertexColor};
use super::motion::{Shutter, Stage, Tracks};
use super::nodes::Hierarchy;
use super::objects::Objects;
use super::place::{self, Placement};
use super::source::Source;
use super::texture::Images;
use super::{camera, choose, fail, light};
use crate::desc::{Category, ObjectId, Pos, Result, SceneDesc, Value};
use crate::math::{DMat4, DQuat, DVec3};

/// Most copies of meshes in a scene.
const MAX_COPIES: usize = 1 << 24;

/// A mesh, or a mesh as one node bends it: index of the mesh, and the node.
type Key = (usize, Option<usize>);

/// A copy of a mesh: the node that holds it, and a transform of its own.
struct Copy {
    node: usize,
    local: DMat4,
}

/// A primitive in the scene.
struct Part {
    primitive: usize,
    geometry: Geometry,
    material: Option<usize>,
}

struct Builder<'a> {
    source: &'a Source,
    stage: &'a Stage,
    objects: Objects,
    materials: Materials<'a>,
    variant: Option<usize>,
    low: DVec3,
    high: DVec3,
    lit: bool,
}

/// Builds the scene description.
pub fn build(source: &Source, options: &LoadOptions, mut objects: Objects) -> Result<SceneDesc> {
    let root = &source.root;
    let hierarchy = Hierarchy::new(root)?;
    let visible = hierarchy.visible(root)?;
    if visible.is_empty() {
        return Err(fail("scenes", "the file shows nothing: no scene of it has nodes"));
    }
    let tracks = Tracks::read(source, options, &mut objects.desc.warnings)?;
    let stage = Stage::new(hierarchy, tracks, Shutter::of(options));
    let variants = root.extensions.variants.variants.iter().map(|v| v.name.as_str());
    let variant = options.variant.as_deref().map(|name| choose("variant", name, variants)).transpose()?;
    let copies = copies(source, &visible)?;
    let used = used_materials(source, copies.keys(), variant)?;
    let images = Images::decode(source, used.into_iter(), options, &mut objects.desc)?;
    let mut builder = Builder {
        source,
        stage: &stage,
        objects,
        materials: Materials::new(source, images),
        variant,
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        lit: false,
    };
    builder.meshes(&copies)?;
    let Builder { mut objects, low, high, mut lit, .. } = builder;
    let around = if low.cmple(high).all() { (low, high) } else { (DVec3::splat(-1.0), DVec3::ONE) };
    let size = (around.1 - around.0).length().max(1e-6);
    for &node in &visible {
        light::add(&mut objects, source, &stage, (node, size))?;
        lit |= source.root.nodes[node].extensions.light.is_some();
    }
    light::surroundings(&mut objects, options, lit)?;
    camera::add(&mut objects, source, &stage, &visible, options, around)?;
    // Light comes through what is cut out.
    let path =
        objects.add(Category::Integrator, "volpath", Pos::default(), vec![("max_depth", Value::Int(-1))]);
    objects.show(path);
    Ok(objects.desc)
}

/// All copies of all meshes, by mesh.
fn copies(source: &Source, visible: &[usize]) -> Result<BTreeMap<Key, Vec<Copy>>> {
    let mut copies: BTreeMap<Key, Vec<Copy>> = BTreeMap::new();
    let mut count = 0;
    for &node in visible {
        let Some(index) = source.root.nodes[node].mesh else { continue };
        let Some(mesh) = source.root.meshes.get(index) else {
            return Err(fail(&format!("nodes[{node}].mesh"), format!("there is no meshes[{index}]")));
        };
        let deforms =
            source.root.nodes[node].skin.is_some() || mesh.primitives.iter().any(|p| !p.targets.is_empty());
        let locals = match &source.root.nodes[node].extensions.instancing {
            Some(instancing) => instances(source, instancing, node)?,
            None => vec![DMat4::IDENTITY],
        };
        count += locals.len();
        if count > MAX_COPIES {
            return Err(fail(
                &format!("nodes[{node}]"),
                format!("the scene has more than {MAX_COPIES} copies of meshes"),
            ));
        }
        let key = (index, deforms.then_some(node));
        copies.entry(key).or_default().extend(locals.into_iter().map(|local| Copy { node, local }));
    }
    Ok(copies)
}

/// The transforms of `EXT_mesh_gpu_instancing`.
fn instances(source: &Source, instancing: &Instancing, node: usize) -> Result<Vec<DMat4>> {
    let at = format!("nodes[{node}].extensions.EXT_mesh_gpu_instancing.attributes");
    let find = |name: &str| instancing.attributes.get(name).map(|i| (*i, format!("{at}.{name}")));
    let translations = find("TRANSLATION").map(|(i, at)| source.vectors::<3>(i, &at)).transpose()?;
    let rotations = find("ROTATION").map(|(i, at)| source.vectors::<4>(i, &at)).transpose()?;
    let scales = find("SCALE").map(|(i, at)| source.vectors::<3>(i, &at)).transpose()?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let mut counts = counts.into_iter().flatten();
    let Some(count) = counts.next() else { return Err(fail(&at, "needs TRANSLATION, ROTATION or SCALE")) };
    if counts.any(|c| c != count) {
        return Err(fail(&at, "its accessors have different counts"));
    }
    source.budget.take(count as u64 * 512, &at)?;
    let transform = |i: usize| {
        let t = translations.as_ref().map_or(DVec3::ZERO, |t| DVec3::from(t[i].map(f64::from)));
        let s = scales.as_ref().map_or(DVec3::ONE, |s| DVec3::from(s[i].map(f64::from)));
        let q = rotations.as_ref().map_or(DQuat::IDENTITY, |r| DQuat::from_array(r[i].map(f64::from)));
        let q = if q.length() > 1e-9 { q.normalize() } else { DQuat::IDENTITY };
        DMat4::from_scale_rotation_translation(s, q, t)
    };
    Ok((0..count).map(transform).collect())
}

/// The material of a primitive under a variant.
fn material_of(primitive: &Primitive, variant: Option<usize>) -> Option<usize> {
    let mappings = &primitive.extensions.variants.mappings;
    let varied = variant.and_then(|v| mappings.iter().find(|m| m.variants.contains(&v)));
    varied.map(|m| m.material).or(primitive.material)
}

/// The materials that are shown.
fn used_materials<'a>(
    source: &'a Source,
    keys: impl Iterator<Item = &'a Key>,
    variant: Option<usize>,
) -> Result<BTreeMap<usize, &'a Material>> {
    let mut used = BTreeMap::new();
    for (mesh, _) in keys {
        for (k, primitive) in source.root.meshes[*mesh].primitives.iter().enumerate() {
            let Some(index) = material_of(primitive, variant) else { continue };
            let place = format!("meshes[{mesh}].primitives[{k}].material");
            let material = source.root.materials.get(index);
            used.insert(
                index,
                material.ok_or_else(|| fail(&place, format!("there is no materials[{index}]")))?,
            );
        }
    }
    Ok(used)
}

impl Builder<'_> {
    fn meshes(&mut self, copies: &BTreeMap<Key, Vec<Copy>>) -> Result<()> {
        // Primitives are decoded once for each mesh, in parallel.
        let indices: Vec<usize> = {
            let mut all: Vec<usize> = copies.keys().map(|(mesh, _)| *mesh).collect();
            all.dedup();
            all
        };
        let (source, variant) = (self.source, self.variant);
        let jobs: Vec<(usize, usize)> = indices
            .iter()
            .flat_map(|mesh| (0..source.root.meshes[*mesh].primitives.len()).map(|p| (*mesh, p)))
            .collect();
        let decoded: Vec<_> = jobs
            .par_iter()
            .map(|(mesh, primitive)| {
                let json = &source.root.meshes[*mesh].primitives[*primitive];
                let index = material_of(json, variant);
                let needs = material::needs(index.map(|i| &source.root.materials[i]));
                let place = format!("meshes[{mesh}].primitives[{primitive}]");
                geometry::read(source, json, &needs, &place).map(|found| (index, found))
            })
            .collect();
        let mut parts: BTreeMap<usize, Vec<Part>> = BTreeMap::new();
        for ((mesh, primitive), result) in jobs.into_iter().zip(decoded) {
            let (material, (found, warnings)) = result?;
            self.objects.desc.warnings.extend(warnings);
            if let Some(geometry) = found {
                parts.entry(mesh).or_default().push(Part { primitive, geometry, material });
            }
        }
        for (key, copies_of) in copies {
            let Some(parts) = parts.get_mut(&key.0) else { continue };
            match key.1 {
                Some(node) => self.deforming(*key, node, parts, copies_of)?,
                None => {
                    // Nobody else needs the vertices, unless a node bends them.
                    let bent = copies.range((key.0, Some(0))..=(key.0, Some(usize::MAX))).next().is_some();
                    self.rigid(key.0, parts, copies_of, bent)?;
                }
            }
        }
        Ok(())
    }

    fn look(&mut self, part: &Part) -> Result<Look> {
        let vertex = VertexColor { rgb: part.geometry.vertex_color, alpha: part.geometry.vertex_alpha };
        self.materials.look(&mut self.objects, part.material, vertex)
    }

    /// A mesh that keeps its shape.
    fn rigid(&mut self, mesh: usize, parts: &mut [Part], copies: &[Copy], keep: bool) -> Result<()> {
        let mut made = Vec::new();
        for part in parts {
            let look = self.look(part)?;
            let place = format!("meshes[{mesh}].primitives[{}]", part.primitive);
            let vertices = &mut part.geometry.mesh;
            let vertices = if keep { vertices.clone() } else { std::mem::take(vertices) };
            made.push(self.made(look, vertices, place));
        }
        self.place(mesh, made, copies)
    }

    /// A mesh that a node's skin or weights bend.
    fn deforming(&mut self, key: Key, node: usize, parts: &[Part], copies: &[Copy]) -> Result<()> {
        let (mesh, json) = (key.0, &self.source.root.nodes[node]);
        let skin =
            json.skin.map(|s| Skin::read(self.source, s, &format!("nodes[{node}].skin"))).transpose()?;
        let weights = json.weights.clone().unwrap_or_else(|| self.source.root.meshes[mesh].weights.clone());
        let mut made = Vec::new();
        for part in parts {
            let place = format!("meshes[{mesh}].primitives[{}]", part.primitive);
            let bent = skin.as_ref().filter(|_| part.geometry.per_vertex > 0);
            let deformer = Deformer { geometry: &part.geometry, skin: bent, node, weights: weights.clone() };
            deformer.check(&place)?;
            let posed = deformer.mesh(self.stage, self.source, &place)?;
            let look = self.look(part)?;
            made.push(self.made(look, posed, place));
        }
        if skin.is_none() {
            return self.place(mesh, made, copies);
        }
        // The joints place a skinned mesh, and its node does not.
        for mut shape in made {
            let still = Placement::Still(crate::math::Transform::IDENTITY);
            self.extend(&shape, &still);
            let object = self.shape(&mut shape, Some(&still));
            self.name(object, node, mesh);
            self.objects.show(object);
        }
        Ok(())
    }

    fn made(&mut self, look: Look, mesh: crate::desc::Mesh, place: String) -> Shape {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let keys = mesh.deformation.iter().flat_map(|k| &k.positions);
        for p in mesh.positions.iter().chain(keys) {
            low = low.min(p.as_dvec3());
            high = high.max(p.as_dvec3());
        }
        let mesh = self.objects.mesh(Arc::new(mesh));
        Shape { look, mesh, mirrored: None, place, corners: place::corners(low, high) }
    }

    /// Calls an object as its node is called, or its mesh.
    fn name(&mut self, object: ObjectId, node: usize, mesh: usize) {
        let names = [&self.source.root.nodes[node].name, &self.source.root.meshes[mesh].name];
        if let Some(name) = names.into_iter().find(|n| !n.is_empty()) {
            self.objects.name(object, name.clone());
        }
    }

    /// One copy is put into the world itself; of several, what does not glow
    /// becomes a group that is placed as often.
    fn place(&mut self, mesh: usize, made: Vec<Shape>, copies: &[Copy]) -> Result<()> {
        let corners: Vec<DVec3> = made.iter().flat_map(|shape| shape.corners.iter().copied()).collect();
        let mut placed = Vec::with_capacity(copies.len());
        for copy in copies {
            match place::of(self.stage, copy.node, &copy.local, &corners) {
                Some(placement) => placed.push((copy.node, placement)),
                None => {
                    let place = format!("nodes[{}]", copy.node);
                    self.objects.warn(&place, "is scaled to nothing: what it holds is left out");
                }
            }
        }
        let (alone, grouped): (Vec<Shape>, Vec<Shape>) =
            made.into_iter().partition(|shape| placed.len() < 2 || shape.look.emitter.is_some());
        for mut shape in alone {
            // What glows is there as often as it is placed.
            let mesh_of = &self.objects.desc.meshes[shape.mesh as usize];
            let bytes = (mesh_of.positions.len() * 32 + mesh_of.triangles.len() * 12) as u64;
            let more = placed.len().saturating_sub(1) as u64;
            self.source.budget.take(bytes.saturating_mul(more), &shape.place)?;
            for (node, placement) in &placed {
                self.extend(&shape, placement);
                let object = self.shape(&mut shape, Some(placement));
                self.name(object, *node, mesh);
                self.objects.show(object);
            }
        }
        if grouped.is_empty() || placed.is_empty() {
            return Ok(());
        }
        for shape in &grouped {
            placed.iter().for_each(|(_, placement)| self.extend(shape, placement));
        }
        let children: Vec<ObjectId> =
            grouped.into_iter().map(|mut shape| self.shape(&mut shape, None)).collect();
        let place = format!("meshes[{mesh}]");
        let pos = self.objects.pos(&place);
        let params = children.into_iter().map(|child| ("", Value::Object(child))).collect();
        let group = self.objects.add(Category::Shape, "shapegroup", pos, params);
        self.objects.name(group, place);
        self.objects.show(group);
        for (node, placement) in placed {
            let pos = self.objects.pos(&format!("nodes[{node}]"));
            let params = vec![("to_world", placement.value()), ("", Value::Object(group))];
            let instance = self.objects.add(Category::Shape, "instance", pos, params);
            self.name(instance, node, mesh);
            self.objects.show(instance);
        }
        Ok(())
    }

    /// Lets the box around the scene hold a shape too.
    fn extend(&mut self, shape: &Shape, placement: &Placement) {
        let matrix = placement.first().matrix;
        for corner in &shape.corners {
            let p = matrix.transform_point3(*corner);
            self.low = self.low.min(p);
            self.high = self.high.max(p);
        }
        self.lit |= shape.look.emitter.is_some();
    }

    /// A `<shape type="mesh">`, in the world or, without a place, in a group.
    fn shape(&mut self, shape: &mut Shape, placement: Option<&Placement>) -> ObjectId {
        // What moves or bends is placed as an instance, whose front a mirroring
        // transform leaves in front.
        let bends = self.objects.desc.meshes[shape.mesh as usize].deformation.len() > 1;
        let flips = match placement {
            Some(Placement::Still(t)) => !bends && t.determinant() < 0.0,
            _ => false,
        };
        let mesh = if flips { self.mirrored(shape) } else { shape.mesh };
        let flat = self.objects.desc.meshes[mesh as usize].normals.is_empty();
        let mut params = vec![("mesh", Value::Mesh(mesh))];
        // Without normals the specification asks for flat ones.
        if flat {
            params.push(("face_normals", Value::Bool(true)));
        }
        if let Some(placement) = placement
            && !matches!(placement, Placement::Still(t) if *t == crate::math::Transform::IDENTITY)
        {
            params.push(("to_world", placement.value()));
        }
        params.push(("", Value::Object(shape.look.bsdf)));
        if let Some(interior) = shape.look.interior {
            params.push(("interior", Value::Object(interior)));
        }
        if let Some(emitter) = shape.look.emitter {
            params.push(("", Value::Object(emitter)));
        }
        let pos = self.objects.pos(&shape.place);
        self.objects.add(Category::Shape, "mesh", pos, params)
    }

    /// The mesh wound the other way round: a mirroring transform of a shape that
    /// stands still turns the winding, and glTF means the front to stay in front.
    fn mirrored(&mut self, shape: &mut Shape) -> u32 {
        if let Some(mesh) = shape.mirrored {
            return mesh;
        }
        let mut mesh = (*self.objects.desc.meshes[shape.mesh as usize]).clone();
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        let id = self.objects.mesh(Arc::new(mesh));
        shape.mirrored = Some(id);
        id
    }
}

/// A primitive ready to be placed.
struct Shape {
    look: Look,
    mesh: u32,
    mirrored: Option<u32>,
    place: String,
    /// Of the box around it, at all times.
    corners: Vec<DVec3>,
}

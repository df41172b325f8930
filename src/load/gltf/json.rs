//! The JSON of a glTF 2.0 file as Rust types: the core and the extensions that
//! are read. Numbers are f64, since transforms are composed in f64.
//!
//! These are our own types rather than those of the `gltf` crate (which the
//! tests read the same files with): its nodes are f32, an animation channel
//! without a node, as `KHR_animation_pointer` has them, fails the whole file,
//! and most extensions are absent from it. Unknown members are skipped here;
//! what `extensionsUsed` names and nobody knows is reported elsewhere.

use serde::Deserialize;
use serde::de::IgnoredAny;

/// Defines structs of JSON members: those in brackets must be there, the others
/// have a default.
macro_rules! members {
    ($($(#[$doc:meta])* $name:ident $([ $($(#[$needed_attr:meta])* $needed:ident: $needed_type:ty,)* ])?
        { $($(#[$attr:meta])* $field:ident: $type:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Debug, Default, Deserialize)]
            #[serde(rename_all = "camelCase")]
            pub struct $name {
                $($($(#[$needed_attr])* pub $needed: $needed_type,)*)?
                $(#[serde(default)] $(#[$attr])* pub $field: $type,)*
            }
        )*
    };
}

members! {
    Root [ asset: Asset, ] {
        accessors: Vec<Accessor>,
        animations: Vec<Animation>,
        buffers: Vec<Buffer>,
        buffer_views: Vec<BufferView>,
        cameras: Vec<Camera>,
        extensions: RootExtensions,
        extensions_used: Vec<String>,
        extensions_required: Vec<String>,
        images: Vec<Image>,
        materials: Vec<Material>,
        meshes: Vec<Mesh>,
        nodes: Vec<Node>,
        samplers: Vec<Sampler>,
        scene: Option<usize>,
        scenes: Vec<Scene>,
        skins: Vec<Skin>,
        textures: Vec<Texture>,
    }
    Asset [ version: String, ] { min_version: Option<String>, }
    RootExtensions {
        #[serde(rename = "KHR_lights_punctual")]
        lights: Lights,
        #[serde(rename = "KHR_materials_variants")]
        variants: Variants,
    }
    Lights { lights: Vec<Light>, }
    Light [
        #[serde(rename = "type")]
        kind: String,
    ] {
        name: String,
        color: Option<[f64; 3]>,
        intensity: Option<f64>,
        spot: Spot,
    }
    Spot { inner_cone_angle: Option<f64>, outer_cone_angle: Option<f64>, }
    Variants { variants: Vec<Named>, }
    Named { name: String, }

    Accessor [
        component_type: u32,
        count: u64,
        #[serde(rename = "type")]
        kind: String,
    ] {
        buffer_view: Option<usize>,
        byte_offset: u64,
        normalized: bool,
        sparse: Option<Sparse>,
    }
    Sparse [ count: u64, indices: SparseIndices, values: SparseValues, ] {}
    SparseIndices [ buffer_view: usize, component_type: u32, ] { byte_offset: u64, }
    SparseValues [ buffer_view: usize, ] { byte_offset: u64, }
    Buffer [ byte_length: u64, ] { uri: Option<String>, extensions: BufferExtensions, }
    BufferExtensions {
        #[serde(rename = "EXT_meshopt_compression")]
        meshopt: Fallback,
    }
    Fallback { fallback: bool, }
    BufferView [ buffer: usize, byte_length: u64, ] { byte_offset: u64, byte_stride: Option<u64>, extensions: ViewExtensions, }
    ViewExtensions {
        #[serde(rename = "EXT_meshopt_compression")]
        meshopt: Option<Meshopt>,
    }
    Meshopt [ buffer: usize, byte_length: u64, byte_stride: u64, count: u64, mode: String, ] { byte_offset: u64, filter: Option<String>, }

    Animation [ channels: Vec<Channel>, samplers: Vec<AnimationSampler>, ] { name: String, }
    Channel [ sampler: usize, target: ChannelTarget, ] {}
    ChannelTarget [ path: String, ] { node: Option<usize>, }
    AnimationSampler [ input: usize, output: usize, ] { interpolation: Option<String>, }

    Camera [
        #[serde(rename = "type")]
        kind: String,
    ] {
        name: String,
        perspective: Option<Perspective>,
        orthographic: Option<Orthographic>,
    }
    Perspective [ yfov: f64, znear: f64, ] { aspect_ratio: Option<f64>, zfar: Option<f64>, }
    Orthographic [ xmag: f64, ymag: f64, zfar: f64, znear: f64, ] {}

    Image {
        name: String,
        uri: Option<String>,
        buffer_view: Option<usize>,
        mime_type: Option<String>,
    }
    Sampler { mag_filter: Option<u32>, wrap_s: Option<u32>, wrap_t: Option<u32>, }
    Texture { sampler: Option<usize>, source: Option<usize>, extensions: TextureExtensions, }
    TextureExtensions {
        #[serde(rename = "EXT_texture_webp")]
        webp: Option<TextureSource>,
        #[serde(rename = "KHR_texture_basisu")]
        basisu: Option<TextureSource>,
        #[serde(rename = "MSFT_texture_dds")]
        dds: Option<TextureSource>,
    }
    TextureSource { source: Option<usize>, }
    /// A reference to a texture; normal and occlusion textures have more members.
    TextureInfo [ index: usize, ] { tex_coord: u32, scale: Option<f64>, extensions: TextureInfoExtensions, }
    TextureInfoExtensions {
        #[serde(rename = "KHR_texture_transform")]
        transform: Option<TextureTransform>,
    }
    TextureTransform {
        offset: [f64; 2],
        rotation: f64,
        scale: Option<[f64; 2]>,
        tex_coord: Option<u32>,
    }

    Mesh [ primitives: Vec<Primitive>, ] { name: String, weights: Vec<f64>, }
    Primitive [ attributes: std::collections::BTreeMap<String, usize>, ] {
        indices: Option<usize>,
        material: Option<usize>,
        mode: Option<u32>,
        targets: Vec<std::collections::BTreeMap<String, usize>>,
        extensions: PrimitiveExtensions,
    }
    PrimitiveExtensions {
        #[serde(rename = "KHR_draco_mesh_compression")]
        draco: Option<Draco>,
        #[serde(rename = "KHR_materials_variants")]
        variants: Mappings,
    }
    Draco [ buffer_view: usize, attributes: std::collections::BTreeMap<String, u32>, ] {}
    Mappings { mappings: Vec<Mapping>, }
    Mapping [ material: usize, variants: Vec<usize>, ] {}

    Node {
        name: String,
        camera: Option<usize>,
        children: Vec<usize>,
        skin: Option<usize>,
        matrix: Option<[f64; 16]>,
        mesh: Option<usize>,
        rotation: Option<[f64; 4]>,
        scale: Option<[f64; 3]>,
        translation: Option<[f64; 3]>,
        weights: Option<Vec<f64>>,
        extensions: NodeExtensions,
    }
    NodeExtensions {
        #[serde(rename = "KHR_lights_punctual")]
        light: Option<NodeLight>,
        #[serde(rename = "EXT_mesh_gpu_instancing")]
        instancing: Option<Instancing>,
    }
    NodeLight [ light: usize, ] {}
    Instancing [ attributes: std::collections::BTreeMap<String, usize>, ] {}
    Scene { nodes: Vec<usize>, }
    Skin [ joints: Vec<usize>, ] { inverse_bind_matrices: Option<usize>, }

    Material {
        name: String,
        pbr_metallic_roughness: Metallic,
        normal_texture: Option<TextureInfo>,
        emissive_texture: Option<TextureInfo>,
        emissive_factor: [f64; 3],
        alpha_mode: Option<String>,
        alpha_cutoff: Option<f64>,
        double_sided: bool,
        extensions: MaterialExtensions,
    }
    Metallic {
        base_color_factor: Option<[f64; 4]>,
        base_color_texture: Option<TextureInfo>,
        metallic_factor: Option<f64>,
        roughness_factor: Option<f64>,
        metallic_roughness_texture: Option<TextureInfo>,
    }
    MaterialExtensions {
        #[serde(rename = "KHR_materials_anisotropy")]
        anisotropy: Option<Anisotropy>,
        #[serde(rename = "KHR_materials_clearcoat")]
        clearcoat: Option<Clearcoat>,
        #[serde(rename = "KHR_materials_diffuse_transmission")]
        diffuse_transmission: Option<DiffuseTransmission>,
        #[serde(rename = "KHR_materials_dispersion")]
        dispersion: Option<Dispersion>,
        #[serde(rename = "KHR_materials_emissive_strength")]
        emissive_strength: Option<EmissiveStrength>,
        #[serde(rename = "KHR_materials_ior")]
        ior: Option<Ior>,
        #[serde(rename = "KHR_materials_iridescence")]
        iridescence: Option<Iridescence>,
        #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
        specular_glossiness: Option<SpecularGlossiness>,
        #[serde(rename = "KHR_materials_sheen")]
        sheen: Option<Sheen>,
        #[serde(rename = "KHR_materials_specular")]
        specular: Option<Specular>,
        #[serde(rename = "KHR_materials_transmission")]
        transmission: Option<Transmission>,
        #[serde(rename = "KHR_materials_unlit")]
        unlit: Option<IgnoredAny>,
        #[serde(rename = "KHR_materials_volume")]
        volume: Option<Volume>,
    }
    Anisotropy {
        anisotropy_strength: f64,
        anisotropy_rotation: f64,
        anisotropy_texture: Option<TextureInfo>,
    }
    Clearcoat {
        clearcoat_factor: f64,
        clearcoat_texture: Option<TextureInfo>,
        clearcoat_roughness_factor: f64,
        clearcoat_roughness_texture: Option<TextureInfo>,
        clearcoat_normal_texture: Option<TextureInfo>,
    }
    DiffuseTransmission {
        diffuse_transmission_factor: f64,
        diffuse_transmission_texture: Option<TextureInfo>,
        diffuse_transmission_color_factor: Option<[f64; 3]>,
        diffuse_transmission_color_texture: Option<TextureInfo>,
    }
    Dispersion { dispersion: f64, }
    EmissiveStrength { emissive_strength: Option<f64>, }
    Ior { ior: Option<f64>, }
    Iridescence {
        iridescence_factor: f64,
        iridescence_texture: Option<TextureInfo>,
        iridescence_ior: Option<f64>,
        iridescence_thickness_minimum: Option<f64>,
        iridescence_thickness_maximum: Option<f64>,
        iridescence_thickness_texture: Option<TextureInfo>,
    }
    SpecularGlossiness {
        diffuse_factor: Option<[f64; 4]>,
        diffuse_texture: Option<TextureInfo>,
        specular_factor: Option<[f64; 3]>,
        glossiness_factor: Option<f64>,
        specular_glossiness_texture: Option<TextureInfo>,
    }
    Sheen {
        sheen_color_factor: [f64; 3],
        sheen_color_texture: Option<TextureInfo>,
        sheen_roughness_factor: f64,
        sheen_roughness_texture: Option<TextureInfo>,
    }
    Specular {
        specular_factor: Option<f64>,
        specular_texture: Option<TextureInfo>,
        specular_color_factor: Option<[f64; 3]>,
        specular_color_texture: Option<TextureInfo>,
    }
    Transmission { transmission_factor: f64, transmission_texture: Option<TextureInfo>, }
    Volume {
        thickness_factor: f64,
        attenuation_distance: Option<f64>,
        attenuation_color: Option<[f64; 3]>,
    }
}

/// Reads the JSON text; errors name the member and the place in the text.
pub fn parse(text: &[u8]) -> Result<Root, String> {
    let describe = |path: &str, e: &serde_json::Error| {
        let path = if path == "." { String::new() } else { format!("{}: ", path) };
        format!("{path}{e}")
    };
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let root: Root = serde_path_to_error::deserialize(&mut deserializer)
        .map_err(|e| describe(&e.path().to_string(), e.inner()))?;
    deserializer.end().map_err(|e| format!("after the JSON object: {e}"))?;
    Ok(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_member() {
        let fails = |text: &str| parse(text.as_bytes()).unwrap_err();
        assert!(
            fails("{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{},{\"mesh\":-1}]}")
                .starts_with("nodes[1].mesh: ")
        );
        assert_eq!(
            fails("{\"asset\":{\"version\":\"2.0\"},\"accessors\":[{\"count\":1,\"type\":\"VEC3\"}]}"),
            "accessors[0]: missing field `componentType` at line 1 column 65"
        );
        assert!(fails("{}").starts_with("missing field `asset`"));
        assert!(fails("{\"asset\":{\"version\":\"2.0\"}} x").starts_with("after the JSON object: "));
        assert!(fails(&"[".repeat(200_000)).contains("recursion limit") || fails("[").contains("line 1"));
    }
}

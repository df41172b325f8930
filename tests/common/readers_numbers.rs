//! Numbers by their bits into scattering and intersection.

use etendue::accel::{Accel, Quality};
use etendue::bsdf::Bsdf;
use etendue::desc::{Curves, Mesh};
use etendue::math::{DMat4, DVec3, Motion, ONE_MINUS_EPSILON, Ray, Rgb, Transform, Vec2, Vec3};
use etendue::shape::{
    Analytic, CurveKind, Cylinder, Disk, Geometry, GeometryBuilder, MeshOptions, Rectangle, Sphere,
    SurfacePoint,
};

/// Takes numbers off the front of the input; zeros when it ends.
struct Bits<'a>(&'a [u8]);

impl Bits<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.byte())
    }

    fn float(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    /// In [0, 1): as it is when it is there, else by its bits.
    fn unit(&mut self) -> f32 {
        let bits = u32::from_le_bytes(self.take());
        let float = f32::from_bits(bits);
        if (0.0..1.0).contains(&float) { float } else { bits as f32 / u32::MAX as f32 * ONE_MINUS_EPSILON }
    }
}

/// Of unit length as far as f32 can, if there is such a vector.
fn normalised(v: Vec3) -> Option<Vec3> {
    let v = v.as_dvec3();
    let largest = v.abs().max_element();
    let unit = (v / largest).try_normalize()?.as_vec3();
    unit.is_normalized().then_some(unit)
}

/// Every example of every kind: nothing but finite values, none negative, for
/// unit directions; no panic for any.
pub fn bsdf(data: &[u8]) {
    thread_local!(static LIST: Vec<(String, Bsdf<'static>)> = Bsdf::examples());
    let mut bits = Bits(data);
    let which = u16::from_le_bytes(bits.take());
    let (wo, wi) = (bits.vector(), bits.vector());
    let (lobe, u) = (bits.unit(), Vec2::new(bits.unit(), bits.unit()));
    LIST.with(|list| {
        let chosen = usize::from(which) % list.len();
        // The last number is all of them: their list may change, what broke one shall stay.
        let chosen = if which == u16::MAX { 0..list.len() } else { chosen..chosen + 1 };
        for (name, bsdf) in &list[chosen] {
            if let (Some(wo), Some(wi)) = (normalised(wo), normalised(wi)) {
                scattering(name, bsdf, (wo, wi), (lobe, u));
            }
            // No contract on the values of these.
            let _ = (bsdf.eval_pdf(wo, wi), bsdf.albedo(wo), bsdf.sample(wo, lobe, u));
        }
    });
}

fn is_colour(c: Rgb) -> bool {
    c.is_finite() && c.min_element() >= 0.0
}

/// Tables of any contents: values and densities are finite, and what is sampled
/// is a direction. A weight may be too large for a number; it is then counted.
pub fn scatter(bsdf: &Bsdf) {
    for i in 0..64u32 {
        let at = |k: u32| (i * k % 64) as f32 / 64.0;
        let direction = |z: f32, turn: f32| {
            let ((s, c), r) = ((turn * std::f32::consts::TAU).sin_cos(), (1.0 - z * z).sqrt());
            Vec3::new(r * c, r * s, z)
        };
        let (wo, wi) = (direction(1.0 - at(27), at(5)), direction(1.0 - at(43).powi(4), at(19)));
        let (value, pdf) = bsdf.eval_pdf(wo, wi);
        assert!(is_colour(value) && pdf.is_finite() && pdf >= 0.0, "eval({wo}, {wi}) = {value}, {pdf}");
        assert!(is_colour(bsdf.albedo(wo)), "albedo({wo}) = {}", bsdf.albedo(wo));
        let Some(s) = bsdf.sample(wo, 0.5, Vec2::new(at(11), at(37))) else { continue };
        assert!(s.wi.is_normalized() && s.pdf.is_finite() && s.pdf > 0.0, "sample({wo}) = {s:?}");
    }
}

fn scattering(name: &str, bsdf: &Bsdf, (wo, wi): (Vec3, Vec3), (lobe, u): (f32, Vec2)) {
    let (value, pdf) = bsdf.eval_pdf(wo, wi);
    assert!(is_colour(value), "{name}: eval({wo}, {wi}) = {value}");
    assert!(pdf.is_finite() && pdf >= 0.0, "{name}: pdf({wo}, {wi}) = {pdf}");
    assert!(is_colour(bsdf.albedo(wo)), "{name}: albedo({wo}) = {}", bsdf.albedo(wo));
    let Some(s) = bsdf.sample(wo, lobe, u) else { return };
    let called = format!("{name}: sample({wo}, {lobe}, {u}) = {s:?}");
    assert!(is_colour(s.weight), "{called}");
    assert!(s.pdf.is_finite() && s.pdf > 0.0 && s.eta.is_finite() && s.eta > 0.0, "{called}");
    assert!(s.wi.is_normalized(), "{called}");
    let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
    assert!(is_colour(value) && pdf.is_finite() && pdf >= 0.0, "{called}; there {value}, {pdf}");
}

/// A few triangles, analytic shapes and an instance, all by the bits of their
/// numbers, and a ray: hits and what they give are finite where the geometry
/// is within the range of positions, and all accelerators agree.
pub fn shape(data: &[u8]) {
    let mut bits = Bits(data);
    let kind = bits.byte();
    let Some(geometry) = geometry(kind, &mut bits) else { return };
    let ray = Ray { time: bits.unit(), ..Ray::new(bits.vector(), bits.vector()) };
    let leave = normalised(bits.vector()).unwrap_or(Vec3::Z);
    let mut nearest = None;
    for prim in 0..geometry.prim_count() {
        let Some(hit) = geometry.intersect(prim, &ray, ray.t_max) else { continue };
        assert!(hit.t > 0.0 && hit.t.is_finite(), "{hit:?}");
        assert!(hit.u.is_finite() && hit.v.is_finite(), "{hit:?}");
        at_hit(&geometry.surface(&ray, &hit), leave, &geometry);
        // What is in a group is in the group's own space.
        if geometry.part_prims(0).any(|p| p == prim) {
            nearest = nearest.into_iter().chain([hit.t]).reduce(f32::min);
        }
    }
    let mut first = None;
    for name in Accel::NAMES {
        let Ok(accel) = Accel::build(Some(*name), Quality::default(), &geometry) else { continue };
        let hit = accel.closest(&geometry, &ray);
        assert_eq!(accel.occluded(&geometry, &ray), hit.is_some(), "{name}: {ray:?}");
        assert_eq!(*first.get_or_insert(hit), hit, "{name}: {ray:?}");
    }
    if let (Some(t), Some(Some(hit))) = (nearest, first) {
        assert!(hit.t <= t, "{hit:?} instead of {t}");
    }
}

/// Within these, products of positions stay in the range of f32.
const RANGE: f32 = 1e17;

fn at_hit(surface: &SurfacePoint, leave: Vec3, geometry: &Geometry) {
    let bounds = geometry.bounds();
    if !(bounds.min.abs().max(bounds.max.abs()).max_element() < RANGE) {
        return;
    }
    assert!(surface.p.is_finite(), "{surface:?}");
    assert!(surface.p_error.is_finite() && surface.p_error.min_element() >= 0.0, "{surface:?}");
    assert!(surface.ng.is_normalized() && surface.ns.is_normalized(), "{surface:?}");
    let ray = surface.spawn(leave);
    assert!(ray.origin.is_finite(), "{surface:?} {ray:?}");
    if surface.planar {
        assert!(geometry.intersect(surface.prim, &ray, ray.t_max).is_none(), "{surface:?} {ray:?}");
    }
}

fn geometry(kind: u8, bits: &mut Bits) -> Option<Geometry> {
    let mut builder = GeometryBuilder::new();
    if kind & 1 != 0 {
        builder.add_analytic(analytic(kind, bits)?);
    } else {
        let to_world = if kind & 2 != 0 { Transform::IDENTITY } else { transform(bits)? };
        let mut mesh = Mesh { triangles: vec![[0, 1, 2], [2, 1, 3]], ..Mesh::default() };
        mesh.positions = (0..4).map(|_| bits.vector()).collect();
        if kind & 4 != 0 {
            mesh.normals = (0..4).map(|_| bits.vector()).collect();
        }
        if mesh.positions.iter().chain(&mesh.normals).any(|v| !v.is_finite()) {
            return None;
        }
        builder.add_mesh(&mesh, &to_world, MeshOptions::default()).ok()?;
        if kind & 64 != 0 {
            let points: Vec<[f32; 4]> =
                (0..5).map(|_| bits.vector().extend(bits.float().abs()).to_array()).collect();
            let which = if kind & 32 != 0 { CurveKind::BSpline } else { CurveKind::Linear };
            builder.add_curves(which, &Curves { points, ends: vec![5] }, &to_world).ok()?;
        }
    }
    if kind & 8 != 0 {
        let part = builder.begin_group();
        builder.add_analytic(Sphere::new(DVec3::ZERO, 1.0, &Transform::IDENTITY, false).ok()?.into());
        let key = |t: Transform, time: f64| (time, t);
        let keys = [key(transform(bits)?, 0.0), key(transform(bits)?, 1.0)];
        let count = if kind & 16 != 0 { 2 } else { 1 };
        builder.add_instance(part, Motion::new(&keys[..count])?);
    }
    Some(builder.finish())
}

/// Three axes and a place.
fn transform(bits: &mut Bits) -> Option<Transform> {
    let [x, y, z, at] = std::array::from_fn(|_| bits.vector().as_dvec3());
    let matrix = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), at.extend(1.0));
    Transform::from_matrix(matrix).filter(|t| t.matrix.is_finite() && t.inverse.is_finite())
}

fn analytic(kind: u8, bits: &mut Bits) -> Option<Analytic> {
    if kind & 64 != 0 {
        let mut examples = Analytic::examples();
        let which = usize::from(bits.byte()) % examples.len();
        return Some(examples.swap_remove(which).1);
    }
    // Most shapes must be scaled the same in all directions.
    let to_world = if kind & 32 != 0 {
        transform(bits)?
    } else {
        let scale = DMat4::from_scale(DVec3::splat(bits.float().into()));
        Transform::from_matrix(DMat4::from_translation(bits.vector().as_dvec3()) * scale)?
    };
    let flip = kind & 128 != 0;
    match kind >> 1 & 3 {
        0 => {
            let (centre, radius) = (bits.vector().as_dvec3(), bits.float());
            Sphere::new(centre, radius.into(), &to_world, flip).ok().map(Into::into)
        }
        1 => Disk::new(&to_world, flip).ok().map(Into::into),
        2 => {
            let ends = [bits.vector().as_dvec3(), bits.vector().as_dvec3()];
            Cylinder::new(ends, bits.float().into(), &to_world, flip).ok().map(Into::into)
        }
        _ => Rectangle::new(&to_world, flip).ok().map(Into::into),
    }
}

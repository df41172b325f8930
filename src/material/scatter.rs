//! The bsdfs of a hit: evaluated and sampled as one.
//!
//! f(wo, wi) = Σ wₖ fₖ(wo, wi). A lobe is chosen with probability wₖ; for
//! smooth lobes the pdf of the direction is that of the mixture, Σ wₖ pₖ, and
//! the weight f / p of the whole mixture, so that the choice adds no variance.

use smallvec::SmallVec;

use crate::bsdf::{Bsdf, BsdfSample, Layered, MetalRough, Principled, PrincipledThin};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// One bsdf in its frame.
#[derive(Clone, Copy, Debug)]
pub struct Lobe<'a> {
    /// Share of the material, in (0, 1]; also its selection probability.
    pub weight: f32,
    /// World to the bsdf's local frame.
    pub frame: Frame,
    /// Normal of the unperturbed frame and the squared roughness of the
    /// shadowing term (0: none), when a map perturbed the frame.
    pub perturbed: Option<(Vec3, f32)>,
    /// What scatters; [`Scatter::bsdf`] tells.
    pub bsdf: Carrier<'a>,
}

/// The bsdf of a lobe.
#[derive(Clone, Copy, Debug)]
pub enum Carrier<'a> {
    /// Itself.
    Plain(Bsdf<'a>),
    /// A large one, by its place in the [`Scatter`].
    Stored(u32),
}

/// A bsdf too large to lie in every lobe.
#[derive(Clone, Debug)]
pub enum Stored<'a> {
    /// The core of a glTF surface.
    MetalRough(MetalRough),
    /// A glTF surface with layers.
    Layered(Layered<'a>),
    /// Mitsuba's principled surface.
    Principled(Principled),
    /// Mitsuba's principled sheet.
    PrincipledThin(PrincipledThin),
}

impl Stored<'_> {
    #[inline]
    fn as_bsdf(&self) -> Bsdf<'_> {
        match self {
            Stored::MetalRough(surface) => surface.into(),
            Stored::Layered(surface) => surface.into(),
            Stored::Principled(surface) => surface.into(),
            Stored::PrincipledThin(surface) => surface.into(),
        }
    }
}

/// The flattened material of a hit. Large, so it is filled in place and used
/// again for the next hit of a path.
#[derive(Clone, Debug, Default)]
pub struct Scatter<'a> {
    lobes: SmallVec<[Lobe<'a>; FEW]>,
    stored: SmallVec<[Stored<'a>; 1]>,
    /// What [`Scatter::has_smooth`], [`Scatter::chooses`] and
    /// [`Scatter::spreads`] say, noted as lobes are added.
    smooth: bool,
    chooses: bool,
    spreads: bool,
}

/// Lobes that need no memory from the heap.
const FEW: usize = 4;

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatterSample {
    /// Unit direction in world space, away from the surface.
    pub wi: Vec3,
    /// f·|cos θi| / pdf.
    pub weight: Rgb,
    /// Per solid angle; the discrete probability of a delta lobe.
    pub pdf: f32,
    /// A delta lobe was sampled.
    pub delta: bool,
    /// The light passed straight through.
    pub null: bool,
    /// η of the transmitted over the incident side; 1 for reflection.
    pub eta: f32,
}

impl ScatterSample {
    /// A lobe's sample with what the whole material makes of it; `None` when
    /// that carries nothing. A weight that is not finite goes on: the path is
    /// to be found and counted.
    #[inline]
    fn checked(sample: &BsdfSample, wi: Vec3, weight: Rgb, pdf: f32) -> Option<ScatterSample> {
        let BsdfSample { delta, null, eta, .. } = *sample;
        let nothing = weight.is_finite() && weight.max_element() <= 0.0;
        (!nothing).then_some(ScatterSample { wi, weight, pdf, delta, null, eta })
    }
}

impl<'a> Lobe<'a> {
    /// An unperturbed lobe.
    #[must_use]
    pub fn new(weight: f32, frame: Frame, bsdf: Bsdf<'a>) -> Lobe<'a> {
        Lobe { weight, frame, perturbed: None, bsdf: Carrier::Plain(bsdf) }
    }

    /// A sample's direction in the world. What goes straight on keeps the very
    /// bits of the way it came.
    fn in_world(&self, sample: &BsdfSample, local: Vec3, wo: Vec3) -> Vec3 {
        if sample.delta && sample.wi == -local { -wo } else { self.frame.to_world(sample.wi) }
    }

    /// Light that a perturbed frame lets through from `wi`: 0 where `wi` is on
    /// different sides of the two normals, else the microfacet shadowing of
    /// Estevez, Lecocq & Stein 2019 (Ray Tracing Gems, chapter 12).
    fn visibility(&self, wi: Vec3, cos_local: f32) -> f32 {
        let Some((normal, alpha2)) = self.perturbed else { return 1.0 };
        let cos = normal.dot(wi);
        if !(cos * cos_local > 0.0) {
            return 0.0;
        }
        let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
        2.0 / (1.0 + (1.0 + alpha2 * tan2).sqrt())
    }

    fn eval_pdf(&self, bsdf: &Bsdf, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let local = self.frame.to_local(wi);
        let visibility = self.visibility(wi, local.z);
        if visibility == 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (f, pdf) = bsdf.eval_pdf(self.frame.to_local(wo), local);
        (f * visibility, pdf)
    }
}

/// Does something with the bsdf of a lobe, wherever that lies.
macro_rules! with_bsdf {
    ($scatter:expr, $lobe:expr, $bsdf:ident => $body:expr) => {
        match &$lobe.bsdf {
            Carrier::Plain($bsdf) => $body,
            Carrier::Stored(index) => {
                let $bsdf = &$scatter.stored[*index as usize].as_bsdf();
                $body
            }
        }
    };
}

impl<'a> Scatter<'a> {
    /// Removes all lobes.
    #[inline]
    pub fn clear(&mut self) {
        self.lobes.clear();
        self.stored.clear();
        (self.smooth, self.chooses, self.spreads) = (false, false, false);
    }

    /// Adds a lobe with a bsdf of its own.
    #[inline(always)]
    pub fn push(&mut self, lobe: Lobe<'a>, bsdf: Bsdf<'a>) {
        self.smooth |= !bsdf.is_delta_only();
        self.chooses |= !self.lobes.is_empty() || bsdf.chooses();
        self.spreads |= bsdf.spreads();
        self.lobes.push(Lobe { bsdf: Carrier::Plain(bsdf), ..lobe });
    }

    /// Adds a lobe with a large bsdf.
    pub fn push_stored(&mut self, lobe: Lobe<'a>, stored: Stored<'a>) {
        self.smooth |= !stored.as_bsdf().is_delta_only();
        self.chooses = true;
        self.spreads = true;
        self.lobes.push(Lobe { bsdf: Carrier::Stored(self.stored.len() as u32), ..lobe });
        self.stored.push(stored);
    }

    /// The bsdf of a lobe of this.
    #[must_use]
    pub fn bsdf(&self, lobe: &Lobe<'a>) -> Bsdf<'_> {
        with_bsdf!(self, lobe, bsdf => *bsdf)
    }

    /// The lobes.
    #[must_use]
    pub fn lobes(&self) -> &[Lobe<'a>] {
        &self.lobes
    }

    /// The shading normal of a surface that reflects from every direction of a side to every other
    /// one of it, mirrors apart; `None` where it transmits, has several normals or may be black
    /// between two directions.
    #[must_use]
    pub fn reflects(&self) -> Option<Vec3> {
        let (first, others) = self.lobes.split_first()?;
        let reflects = |lobe: &Lobe<'a>| self.bsdf(lobe).reflects_everywhere();
        let alike = others.iter().all(|lobe| lobe.frame.n == first.frame.n && reflects(lobe));
        (self.smooth && alike && reflects(first)).then_some(first.frame.n)
    }

    /// True when all that is reflected looks the same from everywhere on its side of the surface.
    #[must_use]
    pub fn is_lambertian(&self) -> bool {
        matches!(self.lobes.as_slice(), [lobe] if matches!(lobe.bsdf, Carrier::Plain(Bsdf::Diffuse(_))))
    }

    /// Normal and reflectance of Lambert's law, if it is all there is to evaluate.
    #[must_use]
    pub fn as_lambertian(&self) -> Option<(Vec3, Rgb)> {
        match self.lobes.as_slice() {
            [Lobe { bsdf: Carrier::Plain(Bsdf::Diffuse(diffuse)), frame, perturbed: None, .. }] => {
                Some((frame.n, diffuse.reflectance))
            }
            _ => None,
        }
    }

    /// Share of the light that passes straight through, as if nothing were
    /// there.
    #[must_use]
    pub fn null_share(&self) -> f32 {
        let null = |lobe: &&Lobe| matches!(lobe.bsdf, Carrier::Plain(Bsdf::Null(_)));
        self.lobes.iter().filter(null).map(|lobe| lobe.weight).sum()
    }

    /// True when some lobe is not a delta: a light can be connected to.
    #[must_use]
    pub fn has_smooth(&self) -> bool {
        self.smooth
    }

    /// True when [`Scatter::sample`] reads its `u_lobe`.
    #[must_use]
    #[inline]
    pub fn chooses(&self) -> bool {
        self.chooses
    }

    /// True when [`Scatter::sample`] reads its `u`.
    #[must_use]
    #[inline]
    pub fn spreads(&self) -> bool {
        self.spreads
    }

    /// f·|cos θi| and the pdf per solid angle of `wi`, non-delta lobes only.
    #[must_use]
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if let [lobe] = self.lobes.as_slice() {
            return with_bsdf!(self, lobe, bsdf => lobe.eval_pdf(bsdf, wo, wi));
        }
        self.lobes.iter().fold((Rgb::ZERO, 0.0), |(f, p), lobe| {
            let (fl, pl) = with_bsdf!(self, lobe, bsdf => lobe.eval_pdf(bsdf, wo, wi));
            (f + fl * lobe.weight, p + pl * lobe.weight)
        })
    }

    /// Samples a direction; `None` when the light is absorbed.
    #[must_use]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<ScatterSample> {
        if let [lobe] = self.lobes.as_slice()
            && lobe.perturbed.is_none()
        {
            let local = lobe.frame.to_local(wo);
            let sample = with_bsdf!(self, lobe, bsdf => bsdf.sample(local, u_lobe, u))?;
            let wi = lobe.in_world(&sample, local, wo);
            return ScatterSample::checked(&sample, wi, sample.weight, sample.pdf);
        }
        let (lobe, u_lobe) = self.choose(u_lobe)?;
        let local = lobe.frame.to_local(wo);
        let sample = with_bsdf!(self, lobe, bsdf => bsdf.sample(local, u_lobe, u))?;
        let wi = lobe.in_world(&sample, local, wo);
        let (mut weight, mut pdf) = (sample.weight, sample.pdf);
        if sample.null {
            // Straight through is not affected by a perturbed frame.
            pdf *= lobe.weight;
        } else {
            let visibility = lobe.visibility(wi, sample.wi.z);
            if visibility == 0.0 {
                return None;
            }
            if self.lobes.len() == 1 {
                weight *= visibility;
            } else if sample.delta {
                weight *= visibility;
                pdf *= lobe.weight;
            } else {
                let (f, p) = self.eval_pdf(wo, wi);
                if p <= 0.0 {
                    return None;
                }
                (weight, pdf) = (f / p, p);
            }
        }
        ScatterSample::checked(&sample, wi, weight, pdf)
    }

    /// The lobe that `u` falls on, and `u` stretched over it.
    fn choose(&self, u: f32) -> Option<(&Lobe<'a>, f32)> {
        if let [lobe] = self.lobes.as_slice() {
            return Some((lobe, u));
        }
        let mut start = 0.0;
        for (i, lobe) in self.lobes.iter().enumerate() {
            if u < start + lobe.weight || i + 1 == self.lobes.len() {
                let stretched = ((u - start) / lobe.weight).clamp(0.0, crate::math::ONE_MINUS_EPSILON);
                return Some((lobe, stretched));
            }
            start += lobe.weight;
        }
        None
    }

    /// An estimate of the share of light that is reflected or transmitted, for
    /// the albedo layer.
    #[must_use]
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        self.lobes
            .iter()
            .map(|lobe| {
                let local = lobe.frame.to_local(wo);
                with_bsdf!(self, lobe, bsdf => bsdf.albedo(local)) * lobe.weight
            })
            .sum()
    }

    /// The shading normal, on the side that the scattering happens, of the
    /// heaviest lobe.
    #[must_use]
    pub fn normal(&self) -> Option<Vec3> {
        self.lobes.iter().max_by(|a, b| a.weight.total_cmp(&b.weight)).map(|l| l.frame.n)
    }
}

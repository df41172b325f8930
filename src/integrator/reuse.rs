//! Paths that several pixels use.
//!
//! The costly part of a path is what comes after its second vertex x₂, and what
//! arrives there says as much about the neighbours as about the pixel whose path
//! found it. So the samples of one index in nearby pixels make groups, and within a
//! group every first vertex is connected to every x₂ (Bekaert, Sbert & Halton 2002,
//! "Accelerating Path Tracing by Re-Using Paths"). With x₂ of pixel j, the estimate for
//! pixel k is
//!
//!   βₖ · fₖ(x₂) · Gₖ(x₂) · L(x₂ → k) / Σₘ pₘ(x₂) Gₘ(x₂),
//!
//! the balance heuristic over who could have found x₂: p is the density of the bsdf of a
//! first vertex per solid angle, G = V·|cos θ₂|/d², L the estimate of what x₂ reflects. The
//! same n² connections give the numerators and the sums, so each pixel traces n − 1 more
//! shadow rays and has n estimates of its indirect light. No bias: groups depend on the
//! first vertices alone, not on what was sampled there.
//!
//! Where x₂ reflects the same to all sides (Lambert) L is one number. Elsewhere it is put
//! together again for each k from the light samples of x₂ and from the one direction ω
//! sampled there, by the bsdf as k sees it. Who could have found ω from x₂ depends on where
//! they came from, so what lies beyond is weighed by Σₘ pₘ Gₘ p₂ₘ(ω), and the power heuristic
//! between light samples and bsdf samples has both sums in it instead of the densities of one
//! path.
//!
//! - A first vertex is the first that light can be connected to. Mirrors and glass before it
//!   belong to the pixel; members of a group have the same number of them, so that the limit on
//!   depth is the same for all.
//! - Only members on one side of x₂ use it, and only where it reflects, and where it does so to
//!   every direction of that side ([`Scatter::reflects`]): then each of them could have found all
//!   that the sums count. What a mirror adds at x₂ stays with the pixel.
//! - Light found by scattered rays at once, and next-event estimation at the first vertex,
//!   stay with the pixel: their noise is small, and MIS weighs them.
//! - Roulette is not played between the two vertices: the densities need not know of it.

use std::f32::consts::PI;

use smallvec::SmallVec;

use super::{CameraSample, Counters, Event, Path, Record};
use crate::film::PixelSample;
use crate::material::Scatter;
use crate::math::{Bounds, Ray, Rgb, Vec3, gamma, offset_origin};
use crate::sampling::power_heuristic;
use crate::scene::{Interaction, Scene};
use crate::shape::SurfacePoint;

/// The first vertex of a path that light can be connected to.
#[derive(Clone, Debug)]
struct First {
    p: Vec3,
    /// Geometric normal, and where rays begin that leave on its side and on the other.
    ng: Vec3,
    origins: [Vec3; 2],
    /// The primitive that these leave out, and its instance.
    skip: [u32; 2],
    wo: Vec3,
    beta: Rgb,
    bounce: u32,
    /// What it lies on and how that is turned: shape, side and the nearest axes.
    like: u64,
    /// Normal and β·ρ/π where it reflects by Lambert's law, and wo lies above.
    lambertian: Option<(Vec3, Rgb)>,
}

impl First {
    fn new(hit: &Interaction, beta: Rgb, bounce: u32) -> First {
        let SurfacePoint { p, ng, ns, shape, .. } = *hit.surface;
        let n = if ns.dot(hit.wo) < 0.0 { -ns } else { ns };
        let axis = |x: f32| if x > 0.5 { 1 } else { 2 * u64::from(x < -0.5) };
        let turned = axis(n.x) + 3 * axis(n.y) + 9 * axis(n.z);
        let [above, below] = [ng, -ng].map(|dir| hit.surface.spawn(dir));
        let above_it = |(n, rho): (Vec3, Rgb)| (n.dot(hit.wo) > 0.0).then_some((n, beta * rho / PI));
        First {
            p,
            ng,
            origins: [above.origin, below.origin],
            skip: [above.skip, above.skip_instance],
            wo: hit.wo,
            beta,
            bounce,
            like: (u64::from(shape) << 5) | turned,
            lambertian: hit.scatter.as_lambertian().and_then(above_it),
        }
    }

    /// The shadow ray to the end of one to a second vertex.
    fn ray_to(&self, towards: Vec3, end: Vec3, skip_end: u32) -> Ray {
        let origin = self.origins[usize::from(towards.dot(self.ng) < 0.0)];
        let [skip, skip_instance] = self.skip;
        // Nothing moves.
        Ray { origin, dir: end - origin, t_max: 1.0, time: 0.0, skip, skip_end, skip_instance }
    }
}

/// A second vertex and what it reflects.
#[derive(Clone, Debug)]
struct Second {
    p: Vec3,
    p_error: Vec3,
    /// The primitive that rays to it leave out.
    skip: u32,
    /// Geometric normal, shading normal and that of its lobes, towards where the path came from.
    normals: [Vec3; 3],
    /// Throughput there.
    beta: Rgb,
    /// What it reflects to all sides; where that differs, only whether there is anything.
    radiance: Rgb,
    /// How that comes about, where it does not reflect the same to all sides.
    parts: Option<Parts>,
}

impl Second {
    /// Where shadow rays end that come from a box on the side of its normals: outside of its
    /// own error box, which includes the rounding of the way ([`SurfacePoint::spawn_to`]).
    fn end(&self, from: &Bounds) -> Vec3 {
        let farthest = (self.p - from.min).abs().max((self.p - from.max).abs());
        let [ng, ..] = self.normals;
        offset_origin(self.p, self.p_error + farthest * gamma(3), ng, ng)
    }

    /// What the pixel gets by it whose path found it.
    fn own(&self) -> Rgb {
        let reflected = match &self.parts {
            None => self.radiance,
            Some(Parts { own, onward, .. }) => *own + onward.as_ref().map_or(Rgb::ZERO, Onward::own),
        };
        self.beta * reflected
    }
}

/// What arrives at a second vertex and is reflected.
#[derive(Clone, Debug, Default)]
struct Parts {
    lights: SmallVec<[LightThere; 2]>,
    /// What the pixel got by them whose path found the vertex.
    own: Rgb,
    onward: Option<Onward>,
}

/// A light sample at a second vertex.
#[derive(Clone, Debug)]
struct LightThere {
    wi: Vec3,
    pdf: f32,
    /// What arrives.
    radiance: Rgb,
    delta: bool,
}

/// The direction sampled at a second vertex.
#[derive(Clone, Debug)]
struct Onward {
    wi: Vec3,
    /// f·|cos θ| / pdf as the pixel sees it that the path began in.
    weight: Rgb,
    pdf: f32,
    delta: bool,
    /// One over the chance with which roulette let the path go on.
    factor: f32,
    /// Emission found there, its MIS weight on that path, and the density of light samples.
    emitted: (Rgb, f32, f32),
    /// Radiance reflected there.
    reflected: Rgb,
}

impl Onward {
    /// What the pixel got by it whose path it is on.
    fn own(&self) -> Rgb {
        let (le, mis, _) = self.emitted;
        self.weight * (le * mis + self.reflected) * self.factor
    }
}

/// A path whose second vertex may be used by others.
#[derive(Clone, Debug, Default)]
pub struct Lender<'s> {
    first: Option<First>,
    second: Option<Second>,
    /// Of the two vertices where Lambert's law does not tell. Apart, since it is large.
    scatter: Box<[Scatter<'s>; 2]>,
    /// What the pixel sees.
    pub sample: PixelSample,
}

/// Notes the two vertices of a path on its way, and passes the rest on.
struct Listener<'a, 's, R> {
    lender: &'a mut Lender<'s>,
    inner: &'a mut R,
    /// What the path had found before what is being noted.
    before: Rgb,
    /// What its throughput has been replaced with.
    scale: f32,
    /// The vertex that what is found comes from: 2, 3, or 0 before the second.
    at: u32,
}

impl<R> Listener<'_, '_, R> {
    /// Sets apart what follows: it is found with the throughput `scale` and is not the pixel's alone.
    fn begin(&mut self, at: u32, (beta, out): (&mut Rgb, &mut Rgb)) -> Rgb {
        let before = *out;
        self.at = at;
        self.scale = beta.max_element();
        *beta = Rgb::splat(self.scale);
        *out = Rgb::ZERO;
        before
    }

    /// Notes what is sampled at a second vertex that does not reflect the same to all sides.
    fn note(&mut self, event: &Event) {
        let Some(Second { parts: Some(parts), .. }) = &mut self.lender.second else { return };
        match *event {
            Event::Light { wi, pdf, radiance, delta, contribution, occluded: false, .. }
                if parts.onward.is_none() =>
            {
                parts.own += contribution / self.scale;
                parts.lights.push(LightThere { wi, pdf, radiance, delta });
            }
            Event::Scatter { wi, weight, pdf, delta } if parts.onward.is_none() => {
                let (factor, emitted, reflected) = (1.0, (Rgb::ZERO, 1.0, 0.0), Rgb::ZERO);
                parts.onward = Some(Onward { wi, weight, pdf, delta, factor, emitted, reflected });
            }
            Event::Roulette { survival, survived } => {
                if let Some(onward) = &mut parts.onward {
                    onward.factor = if survived { 1.0 / survival } else { 0.0 };
                }
            }
            Event::Hit { le, mis } => {
                if let Some(onward) = &mut parts.onward {
                    // The weight is 1 / (1 + (light / pdf)²).
                    let light = onward.pdf * (1.0 / mis - 1.0).max(0.0).sqrt();
                    onward.emitted = (le, mis, light);
                }
            }
            _ => {}
        }
    }
}

impl<'s, R: Record<'s>> Record<'s> for Listener<'_, 's, R> {
    const LENDS: bool = true;

    fn counters(&mut self) -> &mut Counters {
        self.inner.counters()
    }

    #[inline]
    fn event(&mut self, event: impl FnOnce() -> Event) {
        if self.at == 2 {
            let event = event();
            self.note(&event);
            self.inner.event(|| event);
        } else {
            self.inner.event(event);
        }
    }

    fn keeps(&self, bounce: u32) -> bool {
        self.lender.first.as_ref().is_some_and(|first| bounce == first.bounce + 1)
    }

    fn meet(&mut self, hit: &Interaction<'_, 's>, bounce: u32, after_delta: bool, of: (&mut Rgb, &mut Rgb)) {
        let Some(first) = &self.lender.first else {
            if hit.scatter.has_smooth() {
                let first = First::new(hit, *of.0, bounce);
                if first.lambertian.is_none() {
                    self.lender.scatter[0].clone_from(hit.scatter);
                }
                self.lender.first = Some(first);
            }
            return;
        };
        match &self.lender.second {
            None if bounce == first.bounce + 1 && !after_delta && of.0.max_element() > 0.0 => {
                let Some(n) = hit.scatter.reflects() else { return };
                let lambertian = hit.scatter.is_lambertian();
                if !lambertian {
                    self.lender.scatter[1].clone_from(hit.scatter);
                }
                let SurfacePoint { p, p_error, ng, ns, prim, planar, .. } = *hit.surface;
                let towards = |n: Vec3| if n.dot(hit.wo) < 0.0 { -n } else { n };
                self.lender.second = Some(Second {
                    p,
                    p_error,
                    skip: if planar { prim } else { Ray::NO_SKIP },
                    normals: [ng, ns, n].map(towards),
                    beta: *of.0,
                    radiance: Rgb::ZERO,
                    parts: (!lambertian).then(Parts::default),
                });
                self.before = self.begin(2, of);
            }
            Some(Second { parts: Some(_), .. }) if bounce == first.bounce + 2 => {
                // What has been found since the second vertex is noted.
                self.begin(3, of);
            }
            _ => {}
        }
    }
}

impl<'s> Lender<'s> {
    /// Traces the path of a sample: afterwards [`Lender::sample`] is what the pixel sees
    /// without what [`exchange`] adds.
    pub fn trace<R: Record<'s>>(
        &mut self,
        path: &Path,
        scene: &'s Scene,
        camera: &CameraSample,
        record: &mut R,
    ) {
        (self.first, self.second) = (None, None);
        let mut listener = Listener { lender: self, inner: record, before: Rgb::ZERO, scale: 1.0, at: 0 };
        let mut sample = path.sample(scene, camera, &mut listener);
        let Listener { before, scale, at, .. } = listener;
        if let Some(second) = &mut self.second {
            let found = if scale > 0.0 { sample.rgb / scale } else { Rgb::ZERO };
            // Shows what is not finite, wherever it came in.
            let mut whole = found;
            sample.rgb = before;
            match &mut second.parts {
                None => second.radiance = found,
                Some(parts) => {
                    whole += parts.own;
                    for light in &parts.lights {
                        second.radiance += light.radiance;
                    }
                    if let Some(onward) = &mut parts.onward {
                        if at == 3 {
                            onward.reflected = found;
                        }
                        let Onward { emitted: (le, ..), reflected, factor, .. } = *onward;
                        second.radiance += (le + reflected) * factor;
                        if onward.delta {
                            sample.rgb += second.beta * onward.own();
                            parts.onward = None;
                        }
                    }
                }
            }
            whole += second.radiance;
            if !whole.is_finite() {
                // Only this sample is bad.
                sample.rgb += whole;
                self.second = None;
            } else if second.radiance == Rgb::ZERO {
                self.second = None;
            }
        }
        self.sample = sample;
    }

    /// What the pixel sees by its own path alone.
    #[must_use]
    pub fn alone(&self) -> Rgb {
        self.sample.rgb + self.second.as_ref().map_or(Rgb::ZERO, Second::own)
    }

    /// The number of mirrors and panes before the first vertex, if there is one, and a number
    /// for what it lies on and how that is turned: shape, side and the nearest axes.
    #[must_use]
    pub fn kind(&self) -> Option<(u32, u64)> {
        self.first.as_ref().map(|first| (first.bounce, first.like))
    }
}

/// Room for the connections of one second vertex.
#[derive(Debug, Default)]
pub struct Links {
    links: Vec<Link>,
    /// Bsdfs evaluated so far, but for those that are a product of two vectors.
    pub evaluations: u64,
}

/// A first vertex that sees a second one.
#[derive(Debug)]
struct Link {
    member: usize,
    /// Direction from the first to the second.
    wi: Vec3,
    /// β·f·G over the density of the second vertex.
    share: Rgb,
    /// p·G, its part in that density: all of them sum to 1.
    density: f32,
}

/// Makes the second vertices of a group known to all its first vertices. All of them have the
/// same depth ([`Lender::kind`]).
pub fn exchange<'s>(
    scene: &'s Scene,
    all: &mut [Lender<'s>],
    group: &[usize],
    room: &mut Links,
    counters: &mut Counters,
) {
    let bounds = Bounds::of_points(group.iter().filter_map(|i| all[*i].first.as_ref()).map(|first| first.p));
    for &owner in group {
        let Some(second) = &all[owner].second else { continue };
        let end = second.end(&bounds);
        let mut density = 0.0;
        room.links.clear();
        for &member in group {
            let lender = &all[member];
            let Some(first) = &lender.first else { continue };
            let towards = second.p - first.p;
            let distance_squared = towards.length_squared();
            if !second.normals.iter().all(|n| n.dot(towards) < 0.0) {
                continue;
            }
            let distance = distance_squared.sqrt();
            let wi = towards / distance;
            let (f, pdf) = match first.lambertian {
                Some((n, f)) => (f * n.dot(wi), n.dot(wi) / PI),
                None => {
                    room.evaluations += 1;
                    let (f, pdf) = lender.scatter[0].eval_pdf(first.wo, wi);
                    (first.beta * f, pdf)
                }
            };
            // A path of which nothing is left ends, and lends nothing.
            if !(pdf > 0.0 && f.max_element() > 0.0) {
                continue;
            }
            if member != owner {
                counters.shadow_rays += 1;
                if scene.occluded(&first.ray_to(towards, end, second.skip)) {
                    continue;
                }
            }
            // Of the vector itself: its sign is known to be right.
            let g = -second.normals[0].dot(towards) / distance / distance_squared;
            density += pdf * g;
            room.links.push(Link { member, wi, share: f * g, density: pdf * g });
        }
        // Else rounding has turned the direction away from where it was sampled.
        let usable = density > 0.0 && density.is_finite();
        let Some(second) = all[owner].second.take() else { continue };
        if usable {
            for link in &mut room.links {
                link.share /= density;
                link.density /= density;
            }
        }
        match &second.parts {
            None if usable => {
                for link in &room.links {
                    all[link.member].sample.rgb += link.share * second.radiance;
                }
            }
            Some(parts) if usable => {
                room.evaluations += (parts.directions() * room.links.len()) as u64;
                parts.share(all, owner, &room.links, second.beta);
            }
            _ => all[owner].sample.rgb += second.own(),
        }
    }
}

impl Parts {
    /// Directions for which its bsdf is evaluated, for every link.
    fn directions(&self) -> usize {
        self.lights.len() + usize::from(self.onward.is_some())
    }

    /// Adds to the pixels of all links what a second vertex reflects towards them; `beta` is the
    /// throughput of the pixel that found it.
    fn share(&self, all: &mut [Lender], owner: usize, links: &[Link], beta: Rgb) {
        let scatter = std::mem::take(&mut all[owner].scatter[1]);
        let seen = |wi: Vec3| -> (SmallVec<[Rgb; 32]>, f32) {
            let mut sum = 0.0;
            let f = links.iter().map(|link| {
                let (f, pdf) = scatter.eval_pdf(-link.wi, wi);
                if f.max_element() > 0.0 {
                    sum += link.density * pdf;
                }
                f
            });
            (f.collect(), sum)
        };
        for light in &self.lights {
            let (f, by_bsdf) = seen(light.wi);
            let mis = if light.delta { 1.0 } else { power_heuristic(light.pdf, by_bsdf) };
            for (link, f) in links.iter().zip(f) {
                all[link.member].sample.rgb += link.share * f * light.radiance * (mis / light.pdf);
            }
        }
        if let Some(onward) = &self.onward {
            let (f, by_bsdf) = seen(onward.wi);
            if by_bsdf > 0.0 && by_bsdf.is_finite() {
                let (le, _, light) = onward.emitted;
                let mis = power_heuristic(by_bsdf, light);
                let radiance = (le * mis + onward.reflected) * (onward.factor / by_bsdf);
                for (link, f) in links.iter().zip(f) {
                    all[link.member].sample.rgb += link.share * f * radiance;
                }
            } else {
                all[owner].sample.rgb += beta * onward.own();
            }
        }
        all[owner].scatter[1] = scatter;
    }
}

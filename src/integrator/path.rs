//! Unidirectional path tracing with next-event estimation.
//!
//! L = Σₖ βₖ Le(xₖ), estimated at every vertex by two strategies, sampling a
//! light and sampling the bsdf, combined with the power heuristic (Veach 1997,
//! section 9.2.4) in ratio form. Depth is counted as Mitsuba counts it: depth
//! 1 is a light seen directly.
//!
//! Where light passes straight through a surface (`null`, `mask`) there are two
//! ways to go on, with Mitsuba's names. To `path` that is a scattering, shadow rays
//! end there, and there are no media. To `volpath` nothing is there: shadow rays
//! go on, and MIS weighs what a scattered ray finds behind by the density of the
//! last scattering, which both strategies know.
//!
//! Russian roulette (Arvo & Kirk 1990) survives with probability
//! min(1, max(β)·η²) once `rr_depth` is reached: the weight of a survivor is
//! bounded, η² undoes the radiance scaling inside a medium. Mitsuba's cap of
//! 0.95 would make the variance infinite for albedos above 0.975. But mirrors and
//! glass can hold a path without limit for ever: from [`LONG`] scatterings on it goes on with at
//! most [`PATIENCE`], which leaves the variance finite up to an albedo of 0.99997.

use super::connect::{Counts, connect};
use super::{CameraSample, Event, Record, Vertex, first_hit, first_hit_layers};
use crate::film::PixelSample;
use crate::light::Receiver;
use crate::material::Scatter;
use crate::math::{Ray, Rgb, Vec3};
use crate::medium::Medium;
use crate::sampling::power_heuristic;
use crate::scene::{Carried, Interaction, Scene};
use crate::shape::SurfacePoint;

/// The path tracer and its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Longest path in Mitsuba's count; `u32::MAX` is no limit, 0 a black picture.
    pub max_depth: u32,
    /// Depth from which Russian roulette is played.
    pub rr_depth: u32,
    /// Lights are invisible to the camera.
    pub hide_emitters: bool,
    /// Surfaces that let light straight through are not there: they neither end
    /// shadow rays nor make a path longer. Media are.
    pub see_through: bool,
    /// Pixels in a group that uses each other's paths ([`super::reuse`]); 1 for none,
    /// [`super::AUTO_REUSE`] for what a trial finds better.
    pub reuse: u32,
}

/// Scatterings after which a path may be one that never ends.
const LONG: u32 = 1024;

/// The chance that such a path goes on, at most: it takes 16,384 more.
const PATIENCE: f32 = 1.0 - 1.0 / 16_384.0;

/// How the last direction was sampled: what MIS needs to know.
struct Last {
    receiver: Receiver,
    pdf: f32,
    delta: bool,
}

/// The state of a path between two vertices.
struct State {
    ray: Ray,
    beta: Rgb,
    eta: f32,
    /// Scatterings so far.
    bounce: u32,
    /// Those that count.
    depth: u32,
    /// What the ray goes through.
    medium: u32,
    /// The wavelength that is left, once refraction has split the path; else 0.
    wavelength: f32,
    /// Where it comes from: not quite where it begins.
    from: Vec3,
    last: Last,
}

impl State {
    /// What it brings to a surface of that shape.
    #[inline]
    fn carried(&self, scene: &Scene, camera: &CameraSample, surface: &SurfacePoint) -> Carried {
        let mut carried = Carried {
            medium: self.medium,
            wavelength: self.wavelength,
            footprint: camera.footprint(scene, surface),
            fresh: false,
        };
        if scene.plan.dispersion && self.wavelength == 0.0 && scene.disperses(surface.shape) {
            (carried.wavelength, carried.fresh) = (camera.hue().wavelength, true);
        }
        carried
    }

    /// Loses what the medium takes on the way to a point, or to infinity.
    #[inline]
    fn absorb(&mut self, scene: &Scene, to: Option<Vec3>) {
        if self.medium != Medium::NONE {
            let distance = to.map_or(f32::INFINITY, |to| to.distance(self.from));
            self.beta *= scene.transmittance(self.medium, distance);
        }
    }
}

impl Path {
    /// Estimates what one sample of one pixel sees.
    pub fn sample<'s, R: Record<'s>>(
        &self,
        scene: &'s Scene,
        camera: &CameraSample,
        record: &mut R,
    ) -> PixelSample {
        let mut out = PixelSample::default();
        record.counters().paths += 1;
        if self.max_depth == 0 {
            return out;
        }
        let mut state = State {
            ray: camera.ray,
            beta: Rgb::ONE,
            eta: 1.0,
            bounce: 0,
            depth: 0,
            wavelength: 0.0,
            medium: if self.see_through { scene.camera_medium() } else { Medium::NONE },
            from: camera.ray.origin,
            last: Last { receiver: Receiver::free(camera.ray.origin), pdf: 1.0, delta: true },
        };
        if scene.environment.is_some() && !self.hide_emitters {
            out.alpha = 1.0;
        }
        let mut seen = false;
        let mut room = Scatter::default();
        let mut found = first_hit(scene, &mut state.ray, self.hide_emitters, record);
        loop {
            let Some(hit) = found else {
                record.event(|| Event::Left { direction: state.ray.dir });
                state.absorb(scene, None);
                // As Mitsuba: a hidden environment stays hidden behind holes.
                if !self.hide_emitters || seen {
                    out.rgb += self.environment(scene, &state, record);
                }
                return out;
            };
            let surface = scene.surface(&state.ray, &hit);
            state.absorb(scene, Some(surface.p));
            record.event(|| vertex(&surface, &state));
            if state.bounce == 0 {
                first_hit_layers(&mut out, scene, camera, &surface);
            }
            out.rgb += self.hit_light(scene, &surface, &state, record);
            let last_vertex = state.depth + 1 >= self.max_depth;
            if last_vertex {
                if !seen && scene.light_of_shape(surface.shape).is_some() {
                    out.alpha = 1.0;
                }
                if !self.straight_on(scene, &surface, &mut state, &mut room) {
                    return out;
                }
                record.counters().scatter_rays += 1;
                found = scene.closest(&state.ray);
                continue;
            }
            let carried = state.carried(scene, camera, &surface);
            let hit = scene.interact(&surface, -state.ray.dir, &carried, &mut room);
            if R::LENDS {
                record.meet(&hit, state.bounce, state.last.delta, (&mut state.beta, &mut out.rgb));
            }
            out.rgb += self.next_event(scene, camera, &hit, &state, record);
            match self.scatter(scene, (camera, &hit), &mut state, record) {
                Some(null) => {
                    if !null && !seen {
                        seen = true;
                        out.alpha = 1.0;
                    }
                }
                None => {
                    if !seen {
                        out.alpha = 1.0;
                    }
                    return out;
                }
            }
            // What such a path would have found is not known: the film must not take it.
            if !state.beta.is_finite() {
                out.rgb += state.beta;
                return out;
            }
            if !self.survive(camera, &mut state, record) {
                return out;
            }
            record.counters().scatter_rays += 1;
            found = scene.closest(&state.ray);
        }
    }

    /// From the last vertex of a path only what goes straight through leads further:
    /// next-event estimation at the vertex before has gone there too. False when that is
    /// nothing.
    #[inline]
    fn straight_on<'s>(
        &self,
        scene: &'s Scene,
        surface: &SurfacePoint,
        state: &mut State,
        room: &mut Scatter<'s>,
    ) -> bool {
        if !(self.see_through && scene.lets_through(surface.shape)) {
            return false;
        }
        let wi = state.ray.dir;
        let share = scene.interact(surface, -wi, &Carried::NOTHING, room).scatter.null_share();
        state.beta *= share;
        state.ray = surface.spawn(wi);
        state.from = surface.p;
        state.medium = scene.medium_towards(state.medium, surface, wi);
        share > 0.0
    }

    /// Light of the environment, weighed against having sampled it as a light.
    fn environment<'s, R: Record<'s>>(&self, scene: &Scene, state: &State, record: &mut R) -> Rgb {
        let (le, mis) = if state.last.delta {
            (scene.environment(state.ray.dir), 1.0)
        } else {
            let (le, pdf) = scene.environment_and_pdf(state.ray.dir);
            (le, power_heuristic(state.last.pdf, pdf))
        };
        if le == Rgb::ZERO {
            return Rgb::ZERO;
        }
        record.event(|| Event::Hit { le, mis });
        state.beta * le * mis
    }

    /// Light emitted at the vertex, weighed against having sampled it as a light.
    fn hit_light<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        surface: &SurfacePoint,
        state: &State,
        record: &mut R,
    ) -> Rgb {
        let le = scene.emitted(surface, -state.ray.dir);
        if le == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let mis = if state.last.delta {
            1.0
        } else {
            let receiver = &state.last.receiver;
            let distance_squared = (surface.p - receiver.p).length_squared();
            let pdf = scene.light_pdf(receiver, surface, state.ray.dir, distance_squared);
            power_heuristic(state.last.pdf, pdf)
        };
        record.event(|| Event::Hit { le, mis });
        state.beta * le * mis
    }

    /// Next-event estimation: one light sample.
    fn next_event<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        hit: &Interaction,
        state: &State,
        record: &mut R,
    ) -> Rgb {
        if !hit.scatter.has_smooth() {
            return Rgb::ZERO;
        }
        let (choice, u) = camera.light(scene, state.bounce);
        let Some(found) = connect(scene, hit, choice, u, Counts { light: 1.0, bsdf: 1.0 }) else {
            return Rgb::ZERO;
        };
        let through = (state.beta, self.see_through);
        let main = found.main.trace(scene, hit, through, record);
        match found.faint {
            Some(faint) => main + faint.trace(scene, hit, through, record),
            None => main,
        }
    }

    /// Samples the bsdf and moves on; `None` when absorbed, else whether the
    /// path went straight through.
    fn scatter<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        (camera, hit): (&CameraSample, &Interaction),
        state: &mut State,
        record: &mut R,
    ) -> Option<bool> {
        let (lobe, u) = camera.scatter(hit.scatter, state.bounce);
        let Some(sample) = hit.scatter.sample(hit.wo, lobe, u) else {
            record.event(|| Event::Absorbed);
            return None;
        };
        record.event(|| Event::Scatter {
            wi: sample.wi,
            weight: sample.weight,
            pdf: sample.pdf,
            delta: sample.delta,
        });
        state.beta *= sample.weight;
        state.eta *= sample.eta;
        state.ray = hit.surface.spawn(sample.wi);
        if let Some(colour) = hit.split(sample.wi) {
            state.beta *= colour;
            state.wavelength = hit.carried.wavelength;
        }
        if self.see_through {
            state.from = hit.surface.p;
            state.medium = scene.medium_towards(hit.carried.medium, hit.surface, sample.wi);
        }
        let free = sample.null && self.see_through;
        if !free {
            state.last = Last { receiver: hit.receiver(), pdf: sample.pdf, delta: sample.delta };
        }
        state.bounce += 1;
        state.depth += u32::from(!free);
        Some(sample.null)
    }

    /// Russian roulette; false when the path ends.
    fn survive<'s, R: Record<'s>>(&self, camera: &CameraSample, state: &mut State, record: &mut R) -> bool {
        if R::LENDS && record.keeps(state.bounce) {
            return true;
        }
        let mut survival = if state.depth < self.rr_depth {
            1.0
        } else {
            (state.beta.max_element() * state.eta * state.eta).min(1.0)
        };
        // One with a limit ends there.
        if state.bounce >= LONG && self.max_depth == u32::MAX {
            survival *= PATIENCE;
        }
        if survival >= 1.0 {
            return true;
        }
        let survived = camera.roulette(state.bounce) < survival;
        record.event(|| Event::Roulette { survival, survived });
        state.beta /= survival;
        survived
    }
}

fn vertex(surface: &SurfacePoint, state: &State) -> Event {
    Event::Vertex(Vertex {
        bounce: state.bounce,
        p: surface.p,
        ng: surface.ng,
        ns: surface.ns,
        shape: surface.shape,
        beta: state.beta,
    })
}

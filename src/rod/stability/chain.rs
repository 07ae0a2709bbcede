//! The whole manipulator in the second variation: spans and magnets from base to tip.

use crate::math::Triple;
use crate::rod::manipulator::{Manipulator, Part};
use crate::rod::pass::MagnetPass;
use crate::rod::state::State;

use super::rigid::Rigid;
use super::samples::{POINTS, Place, Sample};
use super::span::{BENDING, EXTENSIBLE, Span, places};
use super::stiffness::{Pose, Stiffness};

/// Most steps of the mesh that a span takes in.
const STEPS_MAX: usize = 16;

type Slender = Span<BENDING, { BENDING + 6 }>;
type Stretchy = Span<EXTENSIBLE, { EXTENSIBLE + 6 }>;

/// A link of the chain.
#[derive(Debug, Clone)]
enum Link {
    Rigid(Box<Rigid>),
    Slender(Box<Slender>),
    Stretchy(Box<Stretchy>),
}

/// The spans of one section: their links and samples.
#[derive(Debug, Clone)]
struct Stretch {
    part: usize,
    link: usize,
    samples: usize,
    spans: usize,
}

/// Storage of the second variation. Allocated once for a manipulator.
#[derive(Debug, Clone)]
pub(in crate::rod) struct Chain {
    links: Vec<Link>,
    stretches: Vec<Stretch>,
    places: Vec<Place>,
    samples: Vec<Sample>,
    /// Lowest eigenvalue found last, that of the mode kept in the spans; `None` when they keep none.
    pub(super) lowest: Option<f64>,
}

/// Inner products of an inverse iteration, in the strain energy's metric.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Products {
    /// x E y
    pub mixed: f64,
    /// y E y
    pub image: f64,
}

impl Chain {
    pub(in crate::rod) fn new(parts: &[Part]) -> Self {
        let mut chain = Self {
            links: Vec::new(),
            stretches: Vec::new(),
            places: Vec::new(),
            samples: Vec::new(),
            lowest: None,
        };
        let mut magnets = 0;
        for (part, kind) in parts.iter().enumerate() {
            match kind {
                Part::Magnet(_) => {
                    chain.links.push(Link::Rigid(Box::new(Rigid::new(part, magnets))));
                    magnets += 1;
                }
                Part::Section(section) => {
                    let spans = section.segments.div_ceil(STEPS_MAX);
                    let (link, samples) = (chain.links.len(), chain.places.len());
                    chain.stretches.push(Stretch { part, link, samples, spans });
                    for index in 0..spans {
                        chain.places.extend(places(index, spans, section.segments));
                        chain.links.push(if section.extensible {
                            Link::Stretchy(Box::new(Span::new(section, spans)))
                        } else {
                            Link::Slender(Box::new(Span::new(section, spans)))
                        });
                    }
                }
            }
        }
        chain.samples = vec![Sample::default(); chain.places.len()];
        chain
    }

    /// Takes over the equilibrium of a pass.
    pub(super) fn update(
        &mut self,
        manipulator: &Manipulator,
        gravity: Triple,
        states: &[State],
        magnets: &[MagnetPass],
    ) {
        for stretch in &self.stretches {
            let Part::Section(section) = &manipulator.parts[stretch.part] else { continue };
            let range = stretch.samples..stretch.samples + POINTS * stretch.spans;
            let samples = &mut self.samples[range.clone()];
            section.sample(&states[stretch.part], gravity, &self.places[range], samples);
            let links = &mut self.links[stretch.link..stretch.link + stretch.spans];
            for (link, samples) in links.iter_mut().zip(samples.chunks_exact(POINTS)) {
                match link {
                    Link::Slender(span) => span.update(samples),
                    Link::Stretchy(span) => span.update(samples),
                    Link::Rigid(_) => {}
                }
            }
        }
        for link in &mut self.links {
            let Link::Rigid(rigid) = link else { continue };
            let Part::Magnet(magnet) = &manipulator.parts[rigid.part] else { continue };
            rigid.update(magnet, &magnets[rigid.magnet], [&states[rigid.part], &states[rigid.part + 1]]);
        }
    }

    /// Factors `A - shift E`; returns how many of its eigenvalues are not positive.
    pub(super) fn factor(&mut self, shift: f64) -> u32 {
        let mut stiffness = Stiffness::default();
        let mut negative = 0;
        for link in self.links.iter_mut().rev() {
            let (beyond, count) = match link {
                Link::Rigid(rigid) => (rigid.condense(&stiffness), 0),
                Link::Slender(span) => span.condense(shift, &stiffness),
                Link::Stretchy(span) => span.condense(shift, &stiffness),
            };
            stiffness = beyond;
            negative += count;
        }
        negative
    }

    /// Product of all eigenvalues, of the spans' finite number.
    #[cfg(test)]
    pub(in crate::rod) fn eigenvalue_product(&mut self) -> f64 {
        self.factor(0.0);
        let products = self.links.iter().map(|link| match link {
            Link::Rigid(_) => 1.0,
            Link::Slender(span) => span.pivot_product(),
            Link::Stretchy(span) => span.pivot_product(),
        });
        products.product()
    }

    /// Inverse iteration: replaces the image `y` of the mode `x` by `(A - shift E)^-1 E x`, with the factors
    /// at hand.
    pub(super) fn invert(&mut self) -> Products {
        let mut wrench = Pose::default();
        for link in self.links.iter_mut().rev() {
            wrench = match link {
                Link::Rigid(rigid) => rigid.pull(wrench),
                Link::Slender(span) => span.forward(wrench),
                Link::Stretchy(span) => span.forward(wrench),
            };
        }
        let mut place = Pose::default();
        let mut products = Products::default();
        for link in &mut self.links {
            place = match link {
                Link::Rigid(rigid) => rigid.push(place),
                Link::Slender(span) => {
                    let end = span.backward(place);
                    accumulate(span, &mut products);
                    end
                }
                Link::Stretchy(span) => {
                    let end = span.backward(place);
                    accumulate(span, &mut products);
                    end
                }
            };
        }
        products
    }

    /// Makes `factor` times the image the mode.
    pub(super) fn adopt(&mut self, factor: f64) {
        for link in &mut self.links {
            match link {
                Link::Rigid(_) => {}
                Link::Slender(span) => span.mode = span.image.map(|entry| entry * factor),
                Link::Stretchy(span) => span.mode = span.image.map(|entry| entry * factor),
            }
        }
    }

    /// A mode to begin with: bending and twist that vary slowly along the manipulator and lie in no plane.
    pub(super) fn start_anew(&mut self) {
        self.scale(0.0);
        self.add_pattern(1.0);
    }

    /// Adds a tenth of the pattern of [`Self::start_anew`], so that no mode is absent for its symmetry.
    pub(super) fn stir(&mut self) {
        let strains = self.links.iter().flat_map(|link| match link {
            Link::Rigid(_) => &[][..],
            Link::Slender(span) => &span.mode[..],
            Link::Stretchy(span) => &span.mode[..BENDING],
        });
        let greatest = strains.fold(0.0_f64, |greatest, entry| greatest.max(entry.abs()));
        self.add_pattern(0.1 * greatest);
    }

    fn add_pattern(&mut self, size: f64) {
        // The three components turn at rates without a common period.
        let mut phases = [0.3_f64, 1.9, 4.1];
        let mut next = |strains: &mut [f64]| {
            for (entry, (phase, rate)) in strains.iter_mut().zip(phases.iter_mut().zip([0.41, 0.73, 0.57])) {
                *entry += size * phase.cos();
                *phase += rate;
            }
        };
        for link in &mut self.links {
            match link {
                Link::Rigid(_) => {}
                Link::Slender(span) => span.mode.chunks_exact_mut(3).for_each(&mut next),
                // Strains that shear and stretch are lengths: left alone.
                Link::Stretchy(span) => span.mode[..BENDING].chunks_exact_mut(3).for_each(&mut next),
            }
        }
    }

    /// Multiplies the mode by `factor`.
    pub(super) fn scale(&mut self, factor: f64) {
        for link in &mut self.links {
            match link {
                Link::Rigid(_) => {}
                Link::Slender(span) => span.mode.iter_mut().for_each(|entry| *entry *= factor),
                Link::Stretchy(span) => span.mode.iter_mut().for_each(|entry| *entry *= factor),
            }
        }
    }

    /// `x E x` of the mode.
    pub(super) fn energy(&self) -> f64 {
        let parts = self.links.iter().map(|link| match link {
            Link::Rigid(_) => 0.0,
            Link::Slender(span) => dot(&span.mode, &span.energy(&span.mode)),
            Link::Stretchy(span) => dot(&span.mode, &span.energy(&span.mode)),
        });
        parts.sum()
    }
}

#[inline(always)]
fn accumulate<const N: usize, const D: usize>(span: &Span<N, D>, products: &mut Products) {
    let energy = span.energy(&span.image);
    products.mixed += dot(&span.mode, &energy);
    products.image += dot(&span.image, &energy);
}

#[inline(always)]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

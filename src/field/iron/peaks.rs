//! The largest |B| inside steel of any shape.

use rayon::prelude::*;
use std::ops::Range;

use super::array::{IronArray, apart, moved};
use super::face::{Node, Panel, Point};
use super::surface::mirrored;
use crate::winding::OnEdge;
use fluxform_numerics::vec3::norm;

/// Part of the depth that a place below a node is inside the surface at least: a curved one bends towards it.
const DEEP: f64 = 0.98;
/// Steps from the best node to the largest |B|.
const CLIMBS: usize = 12;
/// Places, one after the other along the surface, that share the parts of panels close to them.
const NEIGHBOURS: usize = 128;

/// The largest |B| of a part of the steel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Peak {
    /// |B|, T.
    pub field_t: f64,
    /// Where, m.
    pub place_m: Point,
    /// Estimated error, T: the difference from what the next coarser resolution has here or as its own
    /// largest; nothing where there is no coarser one.
    pub error_t: Option<f64>,
}

/// How far inside the steel's surface the largest |B| is looked for, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Depths {
    /// In cores.
    pub cores_m: f64,
    /// In the rest.
    pub elsewhere_m: f64,
}

/// The largest |B| of every part of the steel.
#[derive(Debug, Clone, PartialEq)]
pub struct IronPeaks {
    /// In the core of every coil; empty without cores.
    pub cores: Vec<Peak>,
    /// In the rest; `None` where none of that is magnetised.
    pub elsewhere: Option<Peak>,
    /// A tolerance below which finer panels are taken, as far as memory allows; `None` where they are not.
    pub finer_below: Option<f64>,
}

/// Where the largest |B| of an array's steel is looked for, whatever the currents.
#[derive(Debug)]
pub struct PeakSearch<'a> {
    array: &'a IronArray,
    faces: Vec<(Panel, Range<usize>)>,
    /// Places far enough from each other.
    candidates: Vec<Candidate>,
    has_cores: bool,
    /// The same of the next coarser solution, by which errors are estimated.
    coarser: Option<Box<Self>>,
}

impl<'a> PeakSearch<'a> {
    /// At least `depths` inside the surface of the steel of `array`.
    #[must_use]
    pub fn new(array: &'a IronArray, depths: Depths) -> Self {
        let surface = &array.surface;
        let mut search = Self {
            array,
            faces: surface.whole_faces(),
            candidates: Vec::new(),
            has_cores: surface.faces.iter().any(|face| face.bore.is_some()),
            coarser: None,
        };
        let depth_m = |number| match surface.face_of(number).bore {
            Some(_) => depths.cores_m,
            None => depths.elsewhere_m,
        };
        // All mirrored copies together are their own image: what is deep in one is in all.
        let deep = (0..surface.size()).into_par_iter().filter(|number| {
            let place_m = inside(&surface.nodes[*number], depth_m(*number));
            search.is_deep(place_m, depth_m(*number))
        });
        let deep: Vec<usize> = deep.collect();
        let mut sparse: Vec<Candidate> = Vec::new();
        for (image, signs) in array.images.iter().enumerate() {
            for number in &deep {
                fluxform_base::progress::poll();
                let of = |core| moved(&array.positions_m, core, *signs, array.planes_m);
                let depth_m = depth_m(*number);
                let node = mirrored(&surface.nodes[*number], *signs, array.planes_m);
                let place_m = inside(&node, depth_m);
                let far = |other: &Candidate| apart(place_m, other.place_m) >= 0.5 * depth_m;
                if sparse.iter().all(far) {
                    sparse.push(Candidate {
                        image,
                        number: *number,
                        core: surface.face_of(*number).bore.map(of),
                        depth_m,
                        place_m,
                    });
                }
            }
        }
        search.candidates = sparse;
        let coarser = array.coarser.as_deref();
        search.coarser = coarser.map(|coarser| Box::new(PeakSearch::new(coarser, depths)));
        search
    }

    /// The largest |B| with `currents_a`.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub fn peaks(&self, currents_a: &[f64]) -> Result<IronPeaks, OnEdge> {
        let mut peaks = self.own_peaks(currents_a)?;
        let Some(coarser) = &self.coarser else {
            return Ok(peaks);
        };
        let other = coarser.own_peaks(currents_a)?;
        let compare = |peak: &mut Peak, other: &Peak| -> Result<(), OnEdge> {
            let here = norm(coarser.array.field_t(peak.place_m, currents_a)?);
            let apart = |value_t: f64| (peak.field_t - value_t).abs();
            peak.error_t = Some(apart(here).max(apart(other.field_t)));
            Ok(())
        };
        for (peak, other) in peaks.cores.iter_mut().zip(&other.cores) {
            compare(peak, other)?;
        }
        if let (Some(peak), Some(other)) = (&mut peaks.elsewhere, &other.elsewhere) {
            compare(peak, other)?;
        }
        Ok(peaks)
    }

    /// The same, without errors.
    fn own_peaks(&self, currents_a: &[f64]) -> Result<IronPeaks, OnEdge> {
        let layers = self.array.layers_at(currents_a);
        let fields_t = |places_m: &[Point]| -> Result<Vec<f64>, OnEdge> {
            let fields = self.array.fields_of(places_m, currents_a, &layers)?;
            Ok(fields.into_iter().map(norm).collect())
        };
        let places_m = self.candidates.iter().map(|candidate| candidate.place_m);
        let values = places_m
            .collect::<Vec<Point>>()
            .par_chunks(NEIGHBOURS)
            .map(fields_t)
            .collect::<Result<Vec<Vec<f64>>, OnEdge>>()?
            .concat();
        let cores = if self.has_cores { currents_a.len() } else { 0 };
        // The best of every core, then of the rest.
        let mut best: Vec<Option<(f64, &Candidate)>> = vec![None; cores + 1];
        for (candidate, value) in self.candidates.iter().zip(values) {
            let of = &mut best[candidate.core.unwrap_or(cores)];
            if of.is_none_or(|(most, _)| value > most) {
                *of = Some((value, candidate));
            }
        }
        let climb = |best: Option<(f64, &Candidate)>| {
            let peak = best.map(|(value, from)| self.climb(value, from, &fields_t));
            peak.transpose()
        };
        let climbed = best.into_par_iter().map(climb);
        let mut climbed = climbed.collect::<Result<Vec<Option<Peak>>, OnEdge>>()?;
        Ok(IronPeaks {
            elsewhere: climbed.pop().flatten(),
            cores: climbed.into_iter().map(Option::unwrap_or_default).collect(),
            finer_below: self.array.finer_below,
        })
    }

    /// Whether a place is as far inside the surface as that: about it a layer's field grows without bound.
    fn is_deep(&self, place_m: Point, depth_m: f64) -> bool {
        fluxform_base::progress::poll();
        !(self.array).is_within(&self.faces, place_m, DEEP * depth_m)
    }

    /// From a node's place to the largest |B| about it, along the surface at the same depth.
    fn climb(
        &self,
        value_t: f64,
        from: &Candidate,
        fields_t: &impl Fn(&[Point]) -> Result<Vec<f64>, OnEdge>,
    ) -> Result<Peak, OnEdge> {
        let surface = &self.array.surface;
        let face = surface.face_of(from.number);
        let [[mut u, mut v], mut step] = surface.parameters(from.number);
        let mut peak = Peak {
            field_t: value_t,
            place_m: from.place_m,
            error_t: None,
        };
        for _ in 0..CLIMBS {
            let before = peak.field_t;
            let [du, dv] = step;
            let (mut beside, mut places_m) = (Vec::new(), Vec::new());
            for [a, b] in [[u + du, v], [u - du, v], [u, v + dv], [u, v - dv]] {
                if !(0.0..=1.0).contains(&a) || !(0.0..=1.0).contains(&b) {
                    continue;
                }
                let (place_m, area_m2) = face.point(a, b);
                let node = Node { place_m, area_m2 };
                let node = mirrored(&node, self.array.images[from.image], self.array.planes_m);
                let place_m = inside(&node, from.depth_m);
                if self.is_deep(place_m, from.depth_m) {
                    beside.push([a, b]);
                    places_m.push(place_m);
                }
            }
            let values = fields_t(&places_m)?;
            for ((at, place_m), value) in beside.into_iter().zip(places_m).zip(values) {
                if value > peak.field_t {
                    [u, v] = at;
                    (peak.field_t, peak.place_m) = (value, place_m);
                }
            }
            if peak.field_t == before {
                step = step.map(|step| 0.5 * step);
            }
        }
        Ok(peak)
    }
}

/// A node, and the place below it where |B| is looked at.
#[derive(Debug)]
struct Candidate {
    image: usize,
    number: usize,
    core: Option<usize>,
    depth_m: f64,
    place_m: Point,
}

/// The place so far below a node.
fn inside(node: &Node, depth_m: f64) -> Point {
    let by = depth_m / norm(node.area_m2);
    std::array::from_fn(|i| node.place_m[i] - by * node.area_m2[i])
}

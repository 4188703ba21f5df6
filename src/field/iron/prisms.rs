//! Bodies with upright sides, and how they touch: boxes, cylinders, tubes, a plate, cores.

use super::face::{Point, SAME_M};
use super::plate::{Fault, Outline};
use super::round_faces::Site;

/// A rectangle or a disc in plan between two heights, less discs, of one steel. A frame of its own may be turned.
#[derive(Debug, Clone, PartialEq)]
pub struct Prism {
    /// Its outline about its middle.
    pub outline: Outline,
    /// Its middle, m.
    pub centre_m: [f64; 2],
    /// Of its lower and of its upper end, m.
    pub heights_m: [f64; 2],
    /// Holes through it.
    pub holes: Vec<Site>,
    /// Discs about which its ends are cut more finely.
    pub marks: Vec<Site>,
    /// Relative permeability less one.
    pub chi: f64,
    /// The coil whose core it is.
    pub core: Option<usize>,
}

/// How two bodies lie to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Contact {
    /// No common place.
    None,
    /// A line or a point.
    Line,
    /// A part of a side.
    Face,
    /// A volume.
    Volume,
}

impl Contact {
    /// Of shapes whose rims are `apart_m` from each other, below nothing where they overlap.
    fn at(apart_m: f64) -> Self {
        if apart_m > SAME_M {
            Self::None
        } else if apart_m > -SAME_M {
            Self::Line
        } else {
            Self::Face
        }
    }
}

impl Prism {
    /// The disc that it is in plan, its holes filled.
    pub(super) fn disc(&self) -> Option<Site> {
        match self.outline {
            Outline::Rectangle(_) => None,
            Outline::Round(diameter_m) => Some(Site {
                at_m: self.centre_m,
                radius_m: 0.5 * diameter_m,
            }),
        }
    }

    /// The least and the largest corner of what bounds it, m.
    #[must_use]
    pub fn ends_m(&self) -> [Point; 2] {
        let [a, b] = match self.outline {
            Outline::Rectangle(sides) => sides.map(|side| 0.5 * side),
            Outline::Round(diameter) => [0.5 * diameter; 2],
        };
        let ([x, y], [low, high]) = (self.centre_m, self.heights_m);
        [[x - a, y - b, low], [x + a, y + b, high]]
    }

    /// Whether `other` is, in plan, within one of its holes, and clear of the rim or not.
    fn in_hole(&self, other: &Self) -> Option<Contact> {
        let [low, high] = other.ends_m();
        let reach = |hole: &Site| match other.disc() {
            Some(disc) => hole.distance_m(disc.at_m) + disc.radius_m,
            None => {
                let far = [0, 1].map(|k| {
                    let at = hole.at_m[k];
                    (at - low[k]).abs().max((high[k] - at).abs())
                });
                far[0].hypot(far[1])
            }
        };
        let clear = |hole: &Site| hole.radius_m - reach(hole);
        let clear_m = self
            .holes
            .iter()
            .map(clear)
            .fold(f64::NEG_INFINITY, f64::max);
        let fills = |hole: &Site| other.disc().is_some_and(|disc| disc.is(hole));
        if self.holes.iter().any(fills) {
            // Around it they share a side.
            Some(Contact::Face)
        } else if clear_m > -SAME_M {
            Some(Contact::at(clear_m))
        } else {
            None
        }
    }
}

/// How two bodies of one frame lie to each other.
#[must_use]
pub fn contact(a: &Prism, b: &Prism) -> Contact {
    let (own, other) = (a.ends_m(), b.ends_m());
    let apart_m = |k: usize| own[0][k].max(other[0][k]) - own[1][k].min(other[1][k]);
    let heights = Contact::at(apart_m(2));
    let beside = match (a.disc(), b.disc()) {
        (Some(a), Some(b)) => Contact::at(a.apart_m(&b)),
        (None, None) => match [0, 1].map(|k| Contact::at(apart_m(k))) {
            [Contact::Face, Contact::Face] => Contact::Volume,
            [along, across] => along.min(across),
        },
        (Some(disc), None) => Contact::at(from_rectangle_m(&disc, other)),
        (None, Some(disc)) => Contact::at(from_rectangle_m(&disc, own)),
    };
    if heights == Contact::None || beside == Contact::None {
        return Contact::None;
    }
    let round = a.disc().is_some() || b.disc().is_some();
    // Two rectangles share a side or a corner; anything round touches along a line.
    let (shares_area, shares_side) = match (beside, round) {
        (Contact::Volume, _) | (Contact::Face, true) => (true, false),
        (Contact::Line, false) => (false, is_along_side(own, other)),
        _ => (false, false),
    };
    let within = a.in_hole(b).or_else(|| b.in_hole(a));
    match (heights, within) {
        (Contact::Face, Some(within)) => within,
        (_, Some(Contact::None)) => Contact::None,
        (_, Some(_)) => Contact::Line,
        (Contact::Face, None) if shares_area => Contact::Volume,
        (Contact::Face, None) if shares_side => Contact::Face,
        (Contact::Line, None) if shares_area => Contact::Face,
        _ => Contact::Line,
    }
}

/// Whether rectangles that do not overlap share a piece of a side.
fn is_along_side(own: [Point; 2], other: [Point; 2]) -> bool {
    (0..2).any(|k| own[1][k].min(other[1][k]) - own[0][k].max(other[0][k]) > SAME_M)
}

/// Distance of a disc's rim from a rectangle, m.
pub(super) fn from_rectangle_m(disc: &Site, [low, high]: [Point; 2]) -> f64 {
    let beyond = [0, 1].map(|k| (low[k] - disc.at_m[k]).max(disc.at_m[k] - high[k]).max(0.0));
    beyond[0].hypot(beyond[1]) - disc.radius_m
}

/// Whether a mirror across an axis at `plane_m` leaves these groups of bodies that hang together as they are.
#[must_use]
pub fn is_mirrored(groups: &[&[Prism]], axis: usize, plane_m: f64) -> bool {
    let image = |at: [f64; 2]| {
        let mut at = at;
        at[axis] = 2.0 * plane_m - at[axis];
        at
    };
    let image_of = |site: &Site| Site {
        at_m: image(site.at_m),
        ..*site
    };
    let all_in = |own: &[Site], other: &[Site]| {
        own.len() == other.len()
            && (own.iter()).all(|site| other.iter().any(|of| of.is(&image_of(site))))
    };
    let is_image = |own: &Prism, other: &Prism| {
        let middle = Site {
            at_m: image(own.centre_m),
            radius_m: 0.0,
        };
        let ends = [0, 1].map(|k| (own.heights_m[k] - other.heights_m[k]).abs());
        middle.distance_m(other.centre_m) < SAME_M
            && own.outline.is(&other.outline)
            && ends.iter().all(|apart| *apart < SAME_M)
            && own.chi == other.chi
            && own.core.is_some() == other.core.is_some()
            && all_in(&own.holes, &other.holes)
            && all_in(&own.marks, &other.marks)
    };
    let within = |prisms: &[&Prism]| {
        let has_image = |own: &&Prism| prisms.iter().any(|other| is_image(own, other));
        prisms.iter().all(has_image)
    };
    let off_plane = |group: &[Prism]| {
        let ends = group.iter().map(Prism::ends_m);
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), ends| {
            (a.min(ends[0][axis]), b.max(ends[1][axis]))
        });
        low >= plane_m - SAME_M || high <= plane_m + SAME_M
    };
    let all: Vec<&Prism> = groups.iter().copied().flatten().collect();
    let own = |group: &&[Prism]| within(&group.iter().collect::<Vec<_>>()) || off_plane(group);
    within(&all) && groups.iter().all(own)
}

/// Numbers of those that hang together, if `touch` says which two do.
#[must_use]
pub fn connected(count: usize, touch: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for number in 0..count {
        let (with, mut others): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|group| group.iter().any(|other| touch(*other, number)));
        let mut group: Vec<usize> = with.concat();
        group.push(number);
        group.sort_unstable();
        others.push(group);
        groups = others;
    }
    groups.sort_unstable();
    groups
}

/// Of every body the coils above whose cores it is: joined to the core's upper end, so that all turns are passed on the
/// way there from below. `middle_m` is a height between a core's ends; `up`: 1 where heights grow upwards, else -1.
///
/// # Errors
/// [`Fault::Loop`] where the lower end is joined to it too, and the potential has no one value.
pub(super) fn above_cores(
    prisms: &[Prism],
    middle_m: f64,
    up: f64,
) -> Result<Vec<Vec<usize>>, Fault> {
    let mut above = vec![Vec::new(); prisms.len()];
    for (own, prism) in prisms.iter().enumerate() {
        let Some(coil) = prism.core else { continue };
        let others: Vec<usize> = (0..prisms.len()).filter(|k| *k != own).collect();
        let touch = |a: usize, b: usize| contact(&prisms[a], &prisms[b]) >= Contact::Face;
        let at_end = |group: &[usize], upper: bool| {
            let mut at = group.iter().filter(|k| touch(own, **k));
            at.any(|k| {
                let [low, high] = prisms[*k].heights_m;
                let overlap = [prism.heights_m[0].max(low), prism.heights_m[1].min(high)];
                (up * (0.5 * (overlap[0] + overlap[1]) - middle_m) > 0.0) == upper
            })
        };
        for group in connected(others.len(), |a, b| touch(others[a], others[b])) {
            let group: Vec<usize> = group.into_iter().map(|k| others[k]).collect();
            match [at_end(&group, true), at_end(&group, false)] {
                [true, true] => return Err(Fault::Loop(coil)),
                [true, false] => group.iter().for_each(|k| above[*k].push(coil)),
                [false, _] => {}
            }
        }
    }
    Ok(above)
}

//! Given sizes of a coil that is to be wound: whole turns and whole layers must fill them.

use super::domain::{Contradiction, mm};
use super::model::Strand;
use super::problem::{LimitName, Task};

/// Difference from a whole number that is a rounding of the sizes.
const ROUNDING: f64 = 1e-10;

/// A size that whole wires fill.
struct Given {
    name: LimitName,
    /// What it is, as [`Contradiction`] says it.
    what: &'static str,
    wire: &'static str,
    size_m: f64,
    /// The wires lie side by side in this much of it, ...
    filled_m: f64,
    /// ... so often.
    times: f64,
}

/// The task with those of its wires that fill the sizes that are given.
///
/// # Errors
/// The nearest sizes that can be wound, where no wire fills them.
pub(super) fn of_whole_wires(task: &Task) -> Result<Task, Contradiction> {
    let mut strands = task.strands.clone();
    for given in given(task) {
        strands.retain(|strand| given.is_whole(strand));
        if strands.is_empty() {
            return Err(given.refused(&task.strands));
        }
    }
    Ok(Task {
        strands,
        ..task.clone()
    })
}

fn given(task: &Task) -> Vec<Given> {
    let fixed = &task.fixed;
    let length = fixed.length_m.map(|length_m| Given {
        name: LimitName::FixedLength,
        what: "length",
        wire: "turn",
        size_m: length_m,
        filled_m: length_m,
        times: 1.0,
    });
    let diameters = fixed.inner_diameter_m.zip(fixed.outer_diameter_m);
    let depth = diameters.map(|(inner_m, outer_m)| Given {
        name: LimitName::FixedOuter,
        what: "outer diameter",
        wire: "layer",
        size_m: outer_m,
        filled_m: outer_m - inner_m,
        times: 2.0,
    });
    length.into_iter().chain(depth).collect()
}

impl Given {
    fn wires(&self, strand: &Strand) -> f64 {
        self.filled_m / (self.times * strand.diameter_m)
    }

    fn is_whole(&self, strand: &Strand) -> bool {
        let wires = self.wires(strand);
        wires.round() >= 1.0 && (wires - wires.round()).abs() <= ROUNDING
    }

    fn refused(&self, strands: &[Strand]) -> Contradiction {
        // The nearest below and above of all wires; of equal ones the first.
        let [mut below, mut above] = [const { None::<(f64, String)> }; 2];
        for strand in strands {
            let less = self.wires(strand).floor();
            for count in [less, less + 1.0] {
                let filled_m = count * self.times * strand.diameter_m;
                let off_m = filled_m - self.filled_m;
                if count < 1.0 {
                    continue;
                }
                let side = if off_m > 0.0 { &mut above } else { &mut below };
                if side
                    .as_ref()
                    .is_none_or(|(other_m, _)| off_m.abs() < *other_m)
                {
                    let (size, wire) = (mm(self.size_m + off_m), mm(strand.diameter_m));
                    let wires = if count == 1.0 { "" } else { "s" };
                    let text = format!("{size} ({count} {}{wires} of {wire})", self.wire);
                    *side = Some((off_m.abs(), text));
                }
            }
        }
        let nearest: Vec<&str> = [&below, &above]
            .into_iter()
            .flatten()
            .map(|(_, text)| text.as_str())
            .collect();
        let by = [&below, &above].into_iter().flatten();
        Contradiction {
            between: [self.name, LimitName::OneTurn],
            by: by.map(|(off_m, _)| *off_m).fold(f64::INFINITY, f64::min),
            message: format!(
                "the given {} of {} is not filled by whole {}s; give one that is, the nearest: {}",
                self.what,
                mm(self.size_m),
                self.wire,
                nearest.join(" or ")
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::problem::Fixed;
    use super::*;
    use crate::optimum::tests::{seed_limits, task};

    #[test]
    fn given_sizes_are_filled_to_rounding_or_the_nearest_are_named() {
        let mut task = task(seed_limits(), None);
        let wire_m = task.strands[0].diameter_m;
        let mut of = |fixed| {
            task.fixed = fixed;
            of_whole_wires(&task).map(|task| task.strands.len())
        };
        // 98 mm read from a file: 140 turns but for a rounding.
        let length = |length_m| Fixed {
            length_m: Some(length_m),
            ..Fixed::default()
        };
        assert_eq!((wire_m, of(length(98.0 * 1e-3))), (0.0007, Ok(1)));
        assert_eq!(of(Fixed::default()), Ok(1));
        let refused = of(length(0.1)).unwrap_err();
        assert!((refused.by - 1e-4).abs() < 1e-12, "{refused:?}");
        let nearest = "99.4 mm (142 turns of 0.7 mm) or 100.1 mm (143 turns";
        assert!(refused.message.contains(nearest), "{refused:?}");
        let diameters = |outer_m| Fixed {
            inner_diameter_m: Some(0.024),
            outer_diameter_m: Some(outer_m),
            length_m: None,
        };
        assert_eq!(of(diameters(0.038)), Ok(1));
        let refused = of(diameters(0.0245)).unwrap_err();
        assert!(
            refused
                .message
                .ends_with("the nearest: 25.4 mm (1 layer of 0.7 mm)"),
            "{refused:?}"
        );
    }
}

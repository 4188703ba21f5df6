//! `sweep plan`: which designs a sweep computes.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::point::toml_value;
use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::sweep::{ArrayTask, Axis, Mode, POINTS_MAX, PlanFile, Value};
use crate::coil::array_search::search::NOTHING_SEARCHED;
use crate::commands::discretize::with_surface;
use crate::design::named_file::{NamedFile, Role};
use crate::design::search::SearchSpace;
use crate::design::template::{Template, is_within};
use crate::design::{Design, InvalidDocument, Severity, source};
use crate::scene::named_files::NamedContent;
use crate::scene::sources::ShapeSource;
use crate::shape::document::ShapeDocument;

/// Values at fault that are reported one by one.
const LISTED: usize = 20;
/// Sections of which a coil that is searched alone knows nothing.
const OF_STEEL: [&str; 2] = ["plate", "iron"];

/// The options of a plan.
#[derive(Debug, Clone)]
pub struct PlanRequest {
    /// The varied keys; the last is the fastest.
    pub axes: Vec<Axis>,
    /// How each design is computed.
    pub mode: Mode,
    /// Where randomness begins.
    pub seed: u64,
    /// Allowed error.
    pub tolerance: Option<f64>,
    /// The shapes that arrays are searched for.
    pub array: Option<ArrayTask>,
}

impl PlanRequest {
    /// How many designs the axes make.
    ///
    /// # Errors
    /// Axes that do not go together: the same key twice, too many designs.
    pub fn check(&self) -> Result<u64, String> {
        let mut points = 1u64;
        let places: Vec<String> = self.axes.iter().map(|axis| axis.key.clone()).collect();
        check_distinct(&self.axes, &places)?;
        for axis in &self.axes {
            points = points.saturating_mul(axis.values.len() as u64);
        }
        if points > POINTS_MAX {
            return Err(format!(
                "{points} designs are more than {POINTS_MAX}: make a STEP larger or leave values \
                 out"
            ));
        }
        Ok(points)
    }
}

/// That no key is set twice: where each axis' key is in the design, in `places`.
fn check_distinct(axes: &[Axis], places: &[String]) -> Result<(), String> {
    for (at, place) in places.iter().enumerate() {
        let same = |other: &String| is_within(place, other) || is_within(other, place);
        if let Some(other) = places[..at].iter().position(same) {
            return Err(format!(
                "{} and {} set the same key: give all its values in one --set",
                axes[other].key, axes[at].key
            ));
        }
    }
    Ok(())
}

/// The plan for `design`, whose `text` came from `input`.
///
/// Every value of every axis is checked by itself; whether a design's parts fit together is found
/// when it is computed.
///
/// # Errors
/// Values that the design's keys do not take; sizes of a winding that each design finds for itself; files that it
/// names that cannot be read; a search of arrays in which nothing varies.
pub fn plan(
    design: &Design,
    text: String,
    input: Input,
    request: &PlanRequest,
) -> Result<PlanFile, RunError> {
    let path = PathBuf::from(&input.path);
    let template = Template::new(&text, &path).map_err(|e| RunError::Input(e.to_string()))?;
    let axes = &request.axes;
    if matches!(request.mode, Mode::Optimize | Mode::OptimizeWound) {
        check_effective(axes)?;
    }
    let places = places(&template, &path, axes)?;
    check_values(&template, &path, axes, &places)?;
    let searched = axes.iter().any(|axis| axis.key.starts_with("search"));
    if request.array.is_some() && !searched && design.search == SearchSpace::default() {
        return Err(RunError::Input(NOTHING_SEARCHED.to_owned()));
    }
    let mut inputs = vec![input];
    for file in named_files(design, &path, axes, &places) {
        inputs.push(NamedContent::read(file)?.input());
    }
    let plan = PlanFile::new(
        design.name.clone(),
        inputs,
        request.mode,
        request.seed,
        request.tolerance,
        request.axes.clone(),
        text,
    );
    Ok(match &request.array {
        Some(task) => {
            let inputs = shape_inputs(&shapes(task)?);
            plan.for_shapes(task.clone(), inputs)
        }
        None => plan,
    })
}

/// The shapes of an array's search, as their files are now.
pub(super) fn shapes(task: &ArrayTask) -> Result<Vec<ShapeSource>, RunError> {
    let refused = |wrong: InvalidDocument| RunError::Input(wrong.to_string());
    let read = |name: &String| {
        let path = Path::new(name);
        let text = source::text_of(path).map_err(refused)?;
        let (document, _) = ShapeDocument::from_toml(&text, path).map_err(refused)?;
        let input = Some(Input::of_bytes(name, text.as_bytes()));
        Ok(ShapeSource { document, input })
    };
    task.shapes.iter().map(read).collect()
}

/// The files of shapes and their surfaces among the inputs.
pub(super) fn shape_inputs(shapes: &[ShapeSource]) -> Vec<Input> {
    let of = |shape: &ShapeSource| {
        with_surface(&shape.document, shape.input.clone().into_iter().collect())
    };
    shapes.iter().flat_map(of).collect()
}

/// Where in the design the key of each axis is.
fn places(template: &Template, path: &Path, axes: &[Axis]) -> Result<Vec<String>, RunError> {
    let refused = |message| format!("{}: --set {message}", path.display());
    let (mut places, mut faults) = (Vec::new(), Vec::new());
    for axis in axes {
        match template.place(&axis.key) {
            Ok(place) => places.push(place),
            Err(message) => faults.push(refused(message)),
        }
    }
    if faults.is_empty() {
        // An index may be left out.
        faults.extend(check_distinct(axes, &places).err().map(refused));
    }
    if faults.is_empty() {
        Ok(places)
    } else {
        Err(RunError::Input(faults.join("\n")))
    }
}

/// That no axis is of the winding, which is found, or of steel that the search of a coil leaves out.
fn check_effective(axes: &[Axis]) -> Result<(), RunError> {
    for axis in axes {
        let section = axis.key.split('.').next().unwrap_or("");
        let why = if section == "coil" {
            "whatever the given one is; vary limits, wire, core or magnet, or leave out --optimize"
        } else if OF_STEEL.contains(&section) {
            "found without [plate] and [[iron]]; leave out --optimize, or search whole arrays with --for"
        } else {
            continue;
        };
        return Err(RunError::Input(format!(
            "{}: every design of such a sweep has the best winding, {why}",
            axis.key
        )));
    }
    Ok(())
}

/// The role of the file that a key names, if it names one.
fn role_of(place: &str) -> Option<Role> {
    match place.split('.').collect::<Vec<_>>()[..] {
        ["core", "bh_curve"] => Some(Role::Curve),
        ["iron", "surface"] => Some(Role::Mesh(0)),
        ["iron", number, "surface"] => number.parse().ok().map(Role::Mesh),
        _ => None,
    }
}

/// The files that the variants name: of an axis those of all its values, in their order.
fn named_files(design: &Design, path: &Path, axes: &[Axis], places: &[String]) -> Vec<NamedFile> {
    let beside = |file: &String| path.parent().unwrap_or(Path::new("")).join(file);
    let roles: Vec<Option<Role>> = places.iter().map(|place| role_of(place)).collect();
    let mut all = Vec::new();
    for (axis, role) in axes.iter().zip(&roles) {
        let Some(role) = *role else { continue };
        all.extend(axis.values.iter().filter_map(|value| match value {
            Value::Text(file) => Some(NamedFile {
                role,
                path: beside(file),
            }),
            _ => None,
        }));
    }
    let own = design.named_files().into_iter();
    all.extend(own.filter(|file| !roles.contains(&Some(file.role))));
    all
}

fn check_values(
    template: &Template,
    path: &Path,
    axes: &[Axis],
    places: &[String],
) -> Result<(), RunError> {
    let first: Vec<&Value> = axes.iter().map(|axis| &axis.values[0]).collect();
    let mut faults: Vec<String> = Vec::new();
    for (varied, axis) in axes.iter().enumerate() {
        let mut found: Vec<String> = axis
            .values
            .par_iter()
            .flat_map_iter(|value| {
                let mut values = first.clone();
                values[varied] = value;
                fault_of(template, path, axes, places, &values, varied)
            })
            .collect();
        // A fault at the first value of every axis is found once for each axis.
        found.retain(|fault| !faults.contains(fault));
        faults.append(&mut found);
    }
    faults.dedup();
    if faults.is_empty() {
        return Ok(());
    }
    let more = faults.len().saturating_sub(LISTED);
    faults.truncate(LISTED);
    if more > 0 {
        faults.push(format!("and {more} more values"));
    }
    Err(RunError::Input(faults.join("\n")))
}

/// The faults of the design with `values`, each with the setting that is to blame.
fn fault_of(
    template: &Template,
    path: &Path,
    axes: &[Axis],
    places: &[String],
    values: &[&Value],
    varied: usize,
) -> Vec<String> {
    let settings = axes
        .iter()
        .zip(values)
        .map(|(axis, value)| (axis.key.as_str(), toml_value(value)));
    let text = match template.with(settings) {
        Ok(text) => text,
        Err(message) => return vec![format!("{}: --set {message}", path.display())],
    };
    let Err(refused) = Design::check_keys(&text, path) else {
        return Vec::new();
    };
    let faults = refused.faults.list().iter();
    faults
        .filter(|fault| fault.severity == Severity::Error)
        .map(|fault| {
            // A message names iron[0].size_mm[2].
            let place = fault.key.replace('[', ".").replace(']', "");
            let blamed = places.iter().position(|of| is_within(&place, of));
            let blamed = blamed.unwrap_or(varied);
            let setting = format!("{} = {}", axes[blamed].key, toml_value(values[blamed]));
            let help = fault
                .help
                .as_ref()
                .map_or(String::new(), |h| format!(" ({h})"));
            format!("{}: with --set {setting}: {fault}{help}", path.display())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::sweep::axis;
    use crate::design::Need;

    const DESIGN: &str = "name = \"a\"\n[coil]\ninner_diameter_mm = 24.0\n\
                          outer_diameter_mm = 38.0\nlength_mm = 70.0\n[wire]\ndiameter_mm = 0.7\n";

    fn planned(settings: &[&str]) -> Result<PlanFile, String> {
        planned_for(Mode::Evaluate, None, settings)
    }

    fn planned_for(
        mode: Mode,
        array: Option<ArrayTask>,
        settings: &[&str],
    ) -> Result<PlanFile, String> {
        let request = PlanRequest {
            axes: settings.iter().map(|s| axis::parse(s).unwrap()).collect(),
            mode,
            seed: 0,
            tolerance: None,
            array,
        };
        planned_of(DESIGN, &request)
    }

    fn planned_of(text: &str, request: &PlanRequest) -> Result<PlanFile, String> {
        request.check()?;
        let (design, _) = Design::from_toml(text, Path::new("a.toml"), Need::SWEEP).unwrap();
        let input = Input::of_bytes("a.toml", text.as_bytes());
        plan(&design, text.to_owned(), input, request).map_err(|error| error.to_string())
    }

    fn among_iron(mode: Mode, bodies: usize, settings: &[&str]) -> Result<PlanFile, String> {
        let body = "[[iron]]\nshape = \"box\"\nsize_mm = [7, 13, 19]\ncenter_mm = [70, 0, 0]\n";
        let request = PlanRequest {
            axes: settings.iter().map(|s| axis::parse(s).unwrap()).collect(),
            mode,
            seed: 0,
            tolerance: None,
            array: None,
        };
        planned_of(&format!("{DESIGN}{}", body.repeat(bodies)), &request)
    }

    #[test]
    fn bodies_of_iron_are_set_by_their_index() {
        let sizes = "iron.0.size_mm=[7,13,19],[9,13,19]";
        let evaluated = |bodies, settings: &[&str]| among_iron(Mode::Evaluate, bodies, settings);
        assert_eq!(
            evaluated(1, &[sizes]).unwrap().axes[0].key,
            "iron.0.size_mm"
        );
        assert!(evaluated(1, &["iron.size_mm=[7,13,19]"]).is_ok());
        assert!(evaluated(2, &[sizes, "iron.1.center_mm=[70,0,0],[90,0,0]"]).is_ok());
        for (bodies, settings, said) in [
            (2, &["iron.size_mm=[7,13,19]"][..], "name one by its index"),
            (1, &["iron.1.size_mm=[7,13,19]"], "has no [[iron]] 1"),
            (0, &["iron.1.size_mm=[7,13,19]"], "has no [[iron]] 1"),
            (1, &["iron.0=7"], "is a whole [[iron]]"),
            (
                1,
                &[sizes, "iron.size_mm=[7,13,19]"],
                "iron.0.size_mm and iron.size_mm set the same key",
            ),
            (
                1,
                &["wire.diameter_mm=0.7,1.3", "iron.0.size_mm=[7,13,-19]"],
                "with --set iron.0.size_mm = [7, 13, -19]: iron[0].size_mm",
            ),
            (1, &["iron.0.surface=none.stl"], "none.stl"),
        ] {
            let refused = evaluated(bodies, settings).unwrap_err();
            assert!(refused.contains(said), "{refused}");
            assert!(!refused.contains("--set wire."), "{refused}");
        }
        for mode in [Mode::Optimize, Mode::OptimizeWound] {
            for set in [sizes, "plate.thickness_mm=3,5"] {
                let refused = among_iron(mode, 1, &[set]).unwrap_err();
                assert!(
                    refused.contains("found without [plate] and [[iron]]"),
                    "{refused}"
                );
            }
        }
    }

    #[test]
    fn a_value_that_its_key_does_not_take_is_named() {
        let said = planned(&["wire.diameter_mm=-0.7,0.7", "array.rows=1:3:0.5"]).unwrap_err();
        assert!(
            said.contains("with --set wire.diameter_mm = -0.7: wire.diameter_mm:"),
            "{said}"
        );
        assert!(
            said.contains("with --set array.rows = 1.5: array.rows:"),
            "{said}"
        );
        assert!(!said.contains("array.rows = 2:"), "{said}");
        let said = planned(&["wire.diametre_mm=0.7,1.3"]).unwrap_err();
        assert!(said.contains("did you mean diameter_mm?"), "{said}");
        let said = planned(&["array.coupling=full,nine"]).unwrap_err();
        assert!(said.contains("array.coupling = \"nine\""), "{said}");
        let said = planned(&["wire.diameter_mm.x=1"]).unwrap_err();
        assert!(said.contains("diameter_mm is not a section"), "{said}");
        let said = planned(&["core.bh_curve=none.csv"]).unwrap_err();
        assert!(said.contains("none.csv"), "{said}");
    }

    #[test]
    fn parts_that_do_not_fit_together_are_found_when_they_are_computed() {
        let plan = planned(&[
            "coil.inner_diameter_mm=10:30:5",
            "coil.outer_diameter_mm=12:38:2",
        ]);
        assert_eq!(plan.unwrap().points, 5 * 14);
    }

    /// Every design had the same best winding, under names of sizes that it had not.
    #[test]
    fn regression_a_winding_that_is_searched_was_an_axis() {
        for mode in [Mode::Optimize, Mode::OptimizeWound] {
            let said = planned_for(
                mode,
                None,
                &["wire.diameter_mm=0.5,0.7", "coil.turns=700,1400"],
            );
            assert!(said.unwrap_err().starts_with("coil.turns: "));
            assert!(planned_for(mode, None, &["wire.diameter_mm=0.5,0.7"]).is_ok());
        }
    }

    #[test]
    fn an_array_in_which_nothing_varies_is_not_planned() {
        let task = ArrayTask {
            shapes: Vec::new(),
            evaluations: 10,
        };
        let said = planned_for(
            Mode::OptimizeFor,
            Some(task.clone()),
            &["coil.turns=700,1300"],
        )
        .unwrap_err();
        assert_eq!(said, NOTHING_SEARCHED);
        let varied = "search.array.pitch_mm=[40,60],[40,50]";
        assert!(planned_for(Mode::OptimizeFor, Some(task), &[varied]).is_ok());
    }

    #[test]
    fn axes_that_do_not_go_together_are_refused() {
        let said = planned(&["turns.a=1", "wire.diameter_mm=1", "turns.a=2"]).unwrap_err();
        assert!(said.contains("set the same key"), "{said}");
        let said = planned(&["core=1", "core.below_mm=2"]).unwrap_err();
        assert!(said.contains("set the same key"), "{said}");
        let many = "target.height_mm=1:1e5:1";
        let said = planned(&[many, "coil.length_mm=1:1e5:1"]).unwrap_err();
        assert!(said.contains("10000000000 designs are more than"), "{said}");
    }

    #[test]
    fn the_same_request_makes_the_same_plan() {
        let settings = ["wire.diameter_mm=0.5:1.0:0.05", "coil.turns=700,1300"];
        let plan = planned(&settings).unwrap();
        assert_eq!(Ok(&plan), planned(&settings).as_ref());
        assert_eq!(plan.points, 22);
        let other = planned(&settings[..1]).unwrap();
        assert_ne!(plan.plan_sha256, other.plan_sha256);
    }
}

//! The page of a merged sweep: the designs that no other one beats.

use serde_json::{Map, Value, json};

use super::frame::{Page, Section, figure, foot};
use super::html::Html;
use super::inputs::sources;
use super::number::{figures, force, si};
use super::pack::f32s;
use crate::plot::pareto::ParetoPlot;
use fluxform_bundle::artefact::Input;
use fluxform_bundle::sweep::ArrayMerit;

/// Designs that are listed; the table beside has all.
const LISTED: usize = 200;

/// The contents of the page, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepFacts<'a> {
    /// Name of the design.
    pub design: &'a str,
    /// Program that made it.
    pub version: &'a str,
    /// Path and digest of what went in.
    pub inputs: &'a [Input],
    /// Designs of the plan, rows, missing, failed, inaccurate, within their limits.
    pub counts: [u64; 6],
    /// Whether the best are among those within their limits alone.
    pub among_met: bool,
    /// N.
    pub largest_force_n: Option<f64>,
    /// The keys that vary.
    pub keys: Vec<&'a str>,
    /// The best designs.
    pub best: Vec<BestDesign>,
    /// Number in the plan of every point of the plot.
    pub designs: Vec<u64>,
    /// Force against the costs.
    pub plot: &'a ParetoPlot,
}

/// A design on a front.
#[derive(Debug, Clone, PartialEq)]
pub struct BestDesign {
    /// Its number in the plan.
    pub index: u64,
    /// Its values of the keys that vary, as text.
    pub values: Vec<String>,
    /// Absent where no array was searched.
    pub array: Option<ArrayMerit>,
    /// N.
    pub force_n: f64,
    /// ohm, kg, s.
    pub costs: [f64; 3],
    /// The fronts it belongs to.
    pub on: [bool; 3],
    /// Whether it is within its limits.
    pub met: bool,
}

/// The page.
#[must_use]
pub fn page(facts: &SweepFacts) -> String {
    let [points, rows, missing, failed, inaccurate, met] = facts.counts;
    let mut lead = Html::default();
    let largest = facts.largest_force_n.map_or_else(String::new, |f| {
        format!(" The largest force of all is {}.", force(f))
    });
    let text = format!(
        "{rows} of {points} designs, {met} of them within their limits; {} cannot be beaten in \
         {} and one of resistance, mass and settling time at once.{largest}",
        facts.best.len(),
        facts.plot.gain
    );
    lead.element("p class=\"lead\"", &text);
    let mut limits = Html::default();
    limits.raw("<ul class=\"said\">");
    let among = if facts.among_met {
        "The best are chosen among the designs within their limits."
    } else {
        "No design is within its limits: the best are chosen among all."
    };
    limits.element("li", among);
    for (number, what) in [
        (missing, "designs are missing"),
        (failed, "cannot be computed or have no coil"),
        (inaccurate, "miss the requested accuracy"),
    ] {
        if number > 0 {
            limits.element("li", &format!("{number} {what}."));
        }
    }
    limits.raw("</ul>");
    Page {
        kind: "Sweep",
        title: format!("A sweep of {}", facts.design),
        lead,
        sections: vec![
            answer(facts),
            Section {
                id: "limits",
                title: "Limits",
                body: limits,
            },
            sources(facts.inputs),
        ],
        data: drawn(facts),
        foot: foot(facts.version, ""),
    }
    .html()
}

/// Data of the drawings; each front with the numbers of its designs.
fn drawn(facts: &SweepFacts) -> Value {
    let cloud = |points: &[(f64, f64)]| {
        let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        json!({ "x": f32s(x), "y": f32s(y) })
    };
    let fronts = facts.plot.drawn();
    let fronts = fronts.iter().zip(&facts.plot.panels).map(|(panel, given)| {
        let [x_label, y_label] = panel.labels();
        json!({
            "names": panel.names, "units": panel.units, "labels": [x_label, y_label],
            "unmet": cloud(&panel.unmet), "met": cloud(&panel.met), "front": cloud(&panel.front),
            "designs": given.front.iter().map(|at| facts.designs[*at]).collect::<Vec<_>>(),
        })
    });
    let best = facts.best.iter();
    let best: Map<String, Value> = best
        .map(|one| (one.index.to_string(), json!(one.values)))
        .collect();
    json!({ "fronts": fronts.collect::<Vec<_>>(), "keys": facts.keys, "best": best })
}

fn answer(facts: &SweepFacts) -> Section {
    let mut body = Html::default();
    body.raw("<div class=\"pair\">");
    for (number, panel) in facts.plot.drawn().iter().enumerate() {
        let [cost, gain] = panel.names;
        body.raw("<div>")
            .element("h3", &format!("{gain} against {cost}"));
        figure(
            &mut body,
            &format!("front-{number}"),
            &format!("{gain} against {cost}, one dot a design; the table below holds the best"),
            &format!("The line joins the designs that none beats in {gain} and {cost}."),
        );
        body.raw("</div>");
    }
    body.raw("</div>");
    body.raw("<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"The best designs\">")
        .raw("<table><caption>The best designs</caption><thead><tr><th scope=\"col\">design</th>");
    for key in &facts.keys {
        body.element("th scope=\"col\" class=\"n\"", key);
    }
    let for_shapes = facts.best.iter().any(|one| one.array.is_some());
    let of_shapes: &[&str] = if for_shapes {
        &[facts.plot.gain, "gain"]
    } else {
        &[]
    };
    for head in of_shapes
        .iter()
        .chain(&["force", "resistance", "mass", "settling"])
    {
        body.element("th scope=\"col\" class=\"n\"", head);
    }
    body.element(
        "th scope=\"col\"",
        &format!("best in {} and", facts.plot.gain),
    )
    .raw("</tr></thead><tbody>");
    for one in facts.best.iter().take(LISTED) {
        row(&mut body, one);
    }
    body.raw("</tbody></table></div>");
    if facts.best.len() > LISTED {
        let text = format!("The first {LISTED}; the table beside the sweep has all.");
        body.element("p class=\"note\"", &text);
    }
    if for_shapes {
        let text = "The mean force constant, the geometric mean over the shapes, ranks the designs. The gain is over that of \
                    the design's own given array, which the keys may change: gains of two designs need not compare.";
        body.element("p class=\"note\"", text);
    }
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

fn row(body: &mut Html, one: &BestDesign) {
    body.raw("<tr>")
        .element("th scope=\"row\"", &one.index.to_string());
    for value in &one.values {
        body.element("td class=\"n\"", value);
    }
    if let Some(array) = one.array {
        body.element("td class=\"n\"", &si(array.mean_lambda_n_per_m, "N/m"))
            .element("td class=\"n\"", &figures(array.gain, 4));
    }
    let [resistance, mass, settling] = one.costs;
    for text in [
        force(one.force_n),
        si(resistance, "\u{3a9}"),
        si(mass, "kg"),
        si(settling, "s"),
    ] {
        body.element("td class=\"n\"", &text);
    }
    let on: Vec<&str> = ["resistance", "mass", "settling"]
        .into_iter()
        .zip(one.on)
        .filter_map(|(name, on)| on.then_some(name))
        .collect();
    let met = if one.met { "" } else { " (limits not met)" };
    body.element("td", &format!("{}{met}", on.join(", ")))
        .raw("</tr>");
}

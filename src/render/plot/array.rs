//! An array and what is around it, to scale: seen from above and cut along a row of coils.

use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

use super::drawing::Drawing;

/// Size of either view that a drawing aims at, px.
const VIEW_PX: f64 = 400.0;
/// Space left of and below a view for its ticks, and around it, px.
const MARGIN_PX: [f64; 2] = [58.0, 46.0];
const AROUND_PX: f64 = 18.0;
/// Height of the title, and of a line of the legend, px.
const TITLE_PX: f64 = 34.0;
const LEGEND_PX: f64 = 24.0;
const TEXT_PX: u32 = 13;
/// A number in a coil, where it has so much room, px.
const NUMBERED_PX: f64 = 9.0;
/// Ticks along a side, about.
const TICKS: f64 = 6.0;

/// The role of a part: its name, and how it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Where the magnet's centre may be.
    Workspace,
    /// Turns of wire.
    Winding,
    /// Steel below the coils.
    Plate,
    /// Other steel.
    Iron,
    /// Steel inside a winding.
    Core,
    /// The finger's magnet.
    Magnet,
}

/// The look of a role: name in the legend, class on pages, fill, stroke, and whether it is dashed.
struct Look {
    name: &'static str,
    class: &'static str,
    fill: Option<&'static str>,
    stroke: &'static str,
    dashed: bool,
}

impl Role {
    /// All of them, as they are drawn: later ones over earlier ones.
    const ALL: [Self; 6] = [
        Self::Iron,
        Self::Plate,
        Self::Winding,
        Self::Core,
        Self::Workspace,
        Self::Magnet,
    ];

    const fn look(self) -> Look {
        let (name, class, fill, stroke, dashed) = match self {
            Self::Workspace => ("workspace", "workspace", None, "#0072b2", true),
            Self::Winding => ("winding", "winding", Some("#e6a15c"), "#8a4b08", false),
            Self::Plate => ("steel plate", "plate", Some("#c3c9cf"), "#49525c", false),
            Self::Iron => ("steel", "plate", Some("#c3c9cf"), "#49525c", false),
            Self::Core => ("steel core", "core", Some("#9aa3ad"), "#49525c", false),
            Self::Magnet => ("magnet", "magnet", Some("#d98cb3"), "#8f3f6b", false),
        };
        Look {
            name,
            class,
            fill,
            stroke,
            dashed,
        }
    }
}

/// A body, m.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// About an upright axis; without a bore where `inner_m` is 0.
    Tube {
        /// The axis.
        axis_m: [f64; 2],
        /// Radius of the bore.
        inner_m: f64,
        /// Radius.
        outer_m: f64,
        /// Bottom and top.
        z_m: [f64; 2],
    },
    /// A box: its ends along x, y and z.
    Block([[f64; 2]; 3]),
    /// Anything convex, by what is seen of it.
    Outlines {
        /// Ends along x, y and z.
        ends_m: [[f64; 2]; 3],
        /// Corners from above.
        plan_m: Vec<[f64; 2]>,
        /// Corners of its section.
        section_m: Vec<[f64; 2]>,
        /// Whether it is a bore.
        hollow: bool,
    },
}

/// A body and what it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its role.
    pub role: Role,
    /// Its body.
    pub body: Body,
    /// A word in the plan, such as a coil's number.
    pub label: Option<String>,
}

/// The contents of a drawing of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayPlot {
    /// Above the views.
    pub title: String,
    /// The parts.
    pub parts: Vec<Part>,
    /// The section is cut at this y, m.
    pub section_y_m: f64,
}

/// A view of the array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// From above.
    Plan,
    /// Cut along x.
    Section,
}

/// A line or a closed outline of a view, px.
#[derive(Clone)]
enum Outline {
    Circle([f64; 2], f64),
    Rect([f64; 2], [f64; 2]),
    Polygon(Vec<[f64; 2]>),
    Line([f64; 2], [f64; 2]),
}

/// Something drawn: as a role, or as ink.
enum Mark {
    Body(Role, Outline),
    /// A bore shows what is behind it.
    Hole(Role, Outline),
    Rule(Outline, bool),
    Text([f64; 2], String, Side),
}

#[derive(Clone, Copy)]
enum Side {
    Start,
    Middle,
    End,
}

/// A view's marks and its size, px.
struct Panel {
    size: [f64; 2],
    marks: Vec<Mark>,
}

impl Body {
    /// Ends along x, y and z.
    fn ends_m(&self) -> [[f64; 2]; 3] {
        match *self {
            Self::Block(ends) | Self::Outlines { ends_m: ends, .. } => ends,
            Self::Tube {
                axis_m: [x, y],
                outer_m: r,
                z_m,
                ..
            } => [[x - r, x + r], [y - r, y + r], z_m],
        }
    }

    /// Ranges along x that a cut at `y_m` goes through.
    fn cut(&self, y_m: f64) -> Vec<[f64; 2]> {
        match *self {
            Self::Block([x, [low, high], _]) => {
                let through = (low..=high).contains(&y_m);
                through.then_some(x).into_iter().collect()
            }
            Self::Outlines { .. } => Vec::new(),
            Self::Tube {
                axis_m: [x, y],
                inner_m,
                outer_m,
                ..
            } => {
                let half = |r: f64| (r * r - (y - y_m).powi(2)).max(0.0).sqrt();
                match (half(inner_m), half(outer_m)) {
                    (_, 0.0) => Vec::new(),
                    (0.0, outer) => vec![[x - outer, x + outer]],
                    (inner, outer) => vec![[x - outer, x - inner], [x + inner, x + outer]],
                }
            }
        }
    }
}

impl ArrayPlot {
    /// Both views beside each other, with a legend.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let panels = [View::Plan, View::Section].map(|view| self.panel(view));
        let width = panels.iter().map(|panel| panel.size[0]).sum::<f64>();
        let height = panels.iter().fold(0.0_f64, |h, panel| h.max(panel.size[1]));
        let mut scene = Scene::new(width.round(), (TITLE_PX + height + LEGEND_PX).round());
        scene.add(text([0.5 * width, 22.0], &self.title, Side::Middle, true));
        let mut left = 0.0;
        for panel in &panels {
            for mark in &panel.marks {
                add(&mut scene, mark, [left, TITLE_PX]);
            }
            left += panel.size[0];
        }
        let roles = Role::ALL.map(Role::look).into_iter().zip(Role::ALL);
        let roles = roles.filter(|(_, role)| self.has(*role));
        let mut left = MARGIN_PX[0];
        for (look, role) in roles {
            let at = [left, TITLE_PX + height + 4.0];
            let swatch = Outline::Rect(at, [at[0] + 16.0, at[1] + 11.0]);
            add(&mut scene, &Mark::Body(role, swatch), [0.0; 2]);
            scene.add(text(
                [left + 22.0, at[1] + 10.5],
                look.name,
                Side::Start,
                false,
            ));
            left += 42.0 + 7.4 * look.name.len() as f64;
        }
        Drawing::new(scene)
    }

    /// One view as markup for a page, whose style has the colours.
    #[must_use]
    pub fn markup(&self, view: View) -> String {
        let panel = self.panel(view);
        let [width, height] = panel.size;
        let mut svg = format!(
            "<svg class=\"array\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{}\">",
            view.title()
        );
        for mark in &panel.marks {
            match mark {
                Mark::Body(role, outline) => svg.push_str(&shape(outline, role.look().class)),
                Mark::Hole(_, outline) => svg.push_str(&shape(outline, "bore")),
                Mark::Rule(outline, strong) => {
                    svg.push_str(&shape(outline, if *strong { "zero" } else { "rule" }));
                }
                Mark::Text([x, y], text, side) => svg.push_str(&format!(
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{}\">{}</text>",
                    side.class(),
                    text.replace('&', "&amp;").replace('<', "&lt;")
                )),
            }
        }
        svg.push_str("</svg>");
        svg
    }

    /// The names of what is drawn, with their classes on pages.
    #[must_use]
    pub fn legend(&self) -> Vec<(&'static str, &'static str)> {
        let drawn = Role::ALL.into_iter().filter(|role| self.has(*role));
        drawn
            .map(|role| (role.look().name, role.look().class))
            .collect()
    }

    /// Ends of the section along x and z, m.
    #[must_use]
    pub fn section_ends_m(&self) -> [[f64; 2]; 2] {
        [0, 2].map(|axis| self.ends_m(axis))
    }

    /// Closed outlines of the coils and the steel in the section, x and z, m, each with its stroke.
    #[must_use]
    pub fn sections_m(&self) -> Vec<(&'static str, Vec<[f64; 2]>)> {
        let solid = |part: &&Part| !matches!(part.role, Role::Workspace | Role::Magnet);
        let outlines = |part: &Part| -> Vec<Vec<[f64; 2]>> {
            if let Body::Outlines { section_m, .. } = &part.body {
                return vec![section_m.clone()];
            }
            let [_, _, [low, high]] = part.body.ends_m();
            let cuts = part.body.cut(self.section_y_m).into_iter();
            cuts.map(|[from, to]| vec![[from, low], [to, low], [to, high], [from, high]])
                .collect()
        };
        let parts = self.parts.iter().filter(solid);
        let all = parts.flat_map(|part| {
            let stroke = part.role.look().stroke;
            outlines(part)
                .into_iter()
                .map(move |outline| (stroke, outline))
        });
        all.filter(|(_, outline)| outline.len() > 2)
            .map(|(stroke, mut outline)| {
                outline.push(outline[0]);
                (stroke, outline)
            })
            .collect()
    }

    fn has(&self, role: Role) -> bool {
        self.parts.iter().any(|part| part.role == role)
    }

    /// Ends of all parts along an axis.
    fn ends_m(&self, axis: usize) -> [f64; 2] {
        let ends = self.parts.iter().map(|part| part.body.ends_m()[axis]);
        let wider = |[low, high]: [f64; 2], [from, to]: [f64; 2]| [low.min(from), high.max(to)];
        let ends = ends.reduce(wider).unwrap_or([0.0, 1.0]);
        // z = 0 is always seen.
        if axis == 2 {
            wider(ends, [0.0; 2])
        } else {
            ends
        }
    }

    /// Pixels of a metre, the same in both views.
    fn scale(&self) -> f64 {
        let span = |axis| {
            let [low, high] = self.ends_m(axis);
            high - low
        };
        VIEW_PX / (0..3).map(span).fold(1e-9, f64::max)
    }

    fn panel(&self, view: View) -> Panel {
        let scale = self.scale();
        let [across, up] = [self.ends_m(0), self.ends_m(view.up())];
        let top = AROUND_PX + 18.0;
        let place = |x: f64, y: f64| {
            [
                MARGIN_PX[0] + scale * (x - across[0]),
                top + scale * (up[1] - y),
            ]
        };
        let corner = place(across[1], up[0]);
        let size = [corner[0] + AROUND_PX, corner[1] + MARGIN_PX[1]];
        let mut marks = Vec::new();
        for x in ticks(across) {
            let [px, _] = place(x, up[0]);
            let rule = Outline::Line([px, corner[1] + 4.0], [px, corner[1] + 9.0]);
            marks.push(Mark::Rule(rule, false));
            marks.push(Mark::Text([px, corner[1] + 22.0], mm(x), Side::Middle));
        }
        for y in ticks(up) {
            let [_, py] = place(across[0], y);
            let rule = Outline::Line([MARGIN_PX[0] - 9.0, py], [MARGIN_PX[0] - 4.0, py]);
            marks.push(Mark::Rule(rule, false));
            marks.push(Mark::Text(
                [MARGIN_PX[0] - 13.0, py + 4.5],
                mm(y),
                Side::End,
            ));
        }
        let middle = 0.5 * (MARGIN_PX[0] + corner[0]);
        marks.push(Mark::Text(
            [middle, corner[1] + 39.0],
            "x / mm".to_owned(),
            Side::Middle,
        ));
        let name = format!(
            "{}: {} / mm",
            view.title(),
            if view == View::Plan { "y" } else { "z" }
        );
        marks.push(Mark::Text([8.0, 16.0], name, Side::Start));
        for role in Role::ALL {
            for part in self.parts.iter().filter(|part| part.role == role) {
                self.draw(part, view, place, &mut marks);
            }
        }
        if view == View::Section {
            let (from, to) = (place(across[0], 0.0), place(across[1], 0.0));
            marks.push(Mark::Rule(Outline::Line(from, to), true));
            marks.push(Mark::Text(
                [to[0], to[1] - 5.0],
                "z = 0".to_owned(),
                Side::End,
            ));
        }
        Panel { size, marks }
    }

    fn draw(
        &self,
        part: &Part,
        view: View,
        place: impl Fn(f64, f64) -> [f64; 2],
        marks: &mut Vec<Mark>,
    ) {
        let [x, y, z] = part.body.ends_m();
        if let Body::Outlines {
            plan_m,
            section_m,
            hollow,
            ..
        } = &part.body
        {
            let corners = match view {
                View::Plan => plan_m,
                View::Section => section_m,
            };
            let corners: Vec<[f64; 2]> = corners.iter().map(|[x, y]| place(*x, *y)).collect();
            if corners.len() > 2 {
                let outline = Outline::Polygon(corners);
                marks.push(match hollow {
                    true => Mark::Hole(part.role, outline),
                    false => Mark::Body(part.role, outline),
                });
            }
            return;
        }
        if view == View::Section {
            let cuts = part.body.cut(self.section_y_m);
            marks.extend(cuts.into_iter().map(|[from, to]| {
                Mark::Body(part.role, Outline::Rect(place(from, z[1]), place(to, z[0])))
            }));
            return;
        }
        let scale = self.scale();
        let outline = match part.body {
            Body::Block(_) | Body::Outlines { .. } => {
                Outline::Rect(place(x[0], y[1]), place(x[1], y[0]))
            }
            Body::Tube {
                axis_m: [x, y],
                outer_m,
                ..
            } => Outline::Circle(place(x, y), scale * outer_m),
        };
        marks.push(Mark::Body(part.role, outline));
        if let Body::Tube {
            axis_m: [x, y],
            inner_m,
            outer_m,
            ..
        } = part.body
        {
            let centre = place(x, y);
            if inner_m > 0.0 {
                let bore = Outline::Circle(centre, scale * inner_m);
                marks.push(Mark::Hole(part.role, bore));
            }
            let between = 0.5 * scale * (inner_m + outer_m);
            if let Some(label) = part
                .label
                .as_ref()
                .filter(|_| scale * outer_m > NUMBERED_PX)
            {
                // Between bore and edge, where a core does not cover it.
                let at = if inner_m > 0.0 { between } else { 0.0 };
                let at = [centre[0], centre[1] + at + 4.5];
                marks.push(Mark::Text(at, label.clone(), Side::Middle));
            }
        }
    }
}

impl View {
    const fn up(self) -> usize {
        match self {
            Self::Plan => 1,
            Self::Section => 2,
        }
    }

    const fn title(self) -> &'static str {
        match self {
            Self::Plan => "from above",
            Self::Section => "section",
        }
    }
}

impl Side {
    const fn class(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// Round values within `ends`, m.
pub(super) fn ticks(ends: [f64; 2]) -> Vec<f64> {
    let rough = (ends[1] - ends[0]) / TICKS;
    let decade = 10_f64.powf(rough.log10().floor());
    let fits = |factor: &f64| factor * decade >= rough;
    let step = decade * [1.0, 2.0, 5.0, 10.0].into_iter().find(fits).unwrap_or(10.0);
    let range = (ends[0] / step).ceil() as i64..=(ends[1] / step).floor() as i64;
    range.map(|k| k as f64 * step).collect()
}

/// In millimetres, without digits that say nothing.
fn mm(value_m: f64) -> String {
    let rounded = (value_m * 1e6).round() / 1e3;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}

fn shape(outline: &Outline, class: &str) -> String {
    match outline {
        Outline::Circle([x, y], r) => {
            format!("<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\"/>")
        }
        Outline::Rect([x, y], [right, bottom]) => format!(
            "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            right - x,
            bottom - y
        ),
        Outline::Polygon(corners) => format!("<path class=\"{class}\" d=\"{}\"/>", path(corners)),
        Outline::Line([x, y], [right, bottom]) => {
            format!("<path class=\"{class}\" d=\"M{x:.1} {y:.1}L{right:.1} {bottom:.1}\"/>")
        }
    }
}

/// A closed path.
fn path(corners: &[[f64; 2]]) -> String {
    let steps = corners.iter().enumerate().map(|(k, [x, y])| {
        let letter = if k == 0 { 'M' } else { 'L' };
        format!("{letter}{x:.1} {y:.1}")
    });
    steps.chain(std::iter::once("Z".to_owned())).collect()
}

fn text([x, y]: [f64; 2], content: &str, side: Side, bold: bool) -> Primitive {
    Primitive::Text {
        x,
        y,
        content: content.to_owned(),
        size: TEXT_PX,
        anchor: match side {
            Side::Start => TextAnchor::Start,
            Side::Middle => TextAnchor::Middle,
            Side::End => TextAnchor::End,
        },
        rotate: None,
        bold,
        color: None,
    }
}

/// Adds a mark at an offset.
fn add(scene: &mut Scene, mark: &Mark, offset: [f64; 2]) {
    let at = |[x, y]: [f64; 2]| [x + offset[0], y + offset[1]];
    let (outline, fill, stroke, dashed) = match mark {
        Mark::Text(place, content, side) => {
            scene.add(text(at(*place), content, *side, false));
            return;
        }
        Mark::Body(role, outline) => {
            let look = role.look();
            (
                outline,
                look.fill.unwrap_or("none"),
                look.stroke,
                look.dashed,
            )
        }
        Mark::Hole(role, outline) => (outline, "#ffffff", role.look().stroke, false),
        Mark::Rule(outline, strong) => (outline, "none", "#22272e", *strong),
    };
    let dash = dashed.then(|| "5 4".to_owned());
    let mut line = |from: [f64; 2], to: [f64; 2]| {
        let ([x1, y1], [x2, y2]) = (at(from), at(to));
        scene.add(Primitive::Line {
            x1,
            y1,
            x2,
            y2,
            stroke: stroke.into(),
            stroke_width: 1.0,
            stroke_dasharray: dash.clone(),
        });
    };
    match outline.clone() {
        Outline::Line(from, to) => line(from, to),
        Outline::Polygon(corners) => {
            let corners: Vec<[f64; 2]> = corners.into_iter().map(at).collect();
            scene.add(Primitive::Path(Box::new(PathData {
                d: path(&corners),
                fill: Some(fill.into()),
                stroke: stroke.into(),
                stroke_width: 1.0,
                opacity: None,
                stroke_dasharray: None,
            })));
        }
        Outline::Rect([x, y], [right, bottom]) if dashed => {
            let corners = [[x, y], [right, y], [right, bottom], [x, bottom]];
            for (k, corner) in corners.iter().enumerate() {
                line(*corner, corners[(k + 1) % 4]);
            }
        }
        Outline::Rect(from, [right, bottom]) => {
            let [x, y] = at(from);
            scene.add(Primitive::Rect {
                x,
                y,
                width: right - from[0],
                height: bottom - from[1],
                fill: fill.into(),
                stroke: Some(stroke.into()),
                stroke_width: Some(1.0),
                opacity: None,
            });
        }
        Outline::Circle(centre, r) => {
            let [cx, cy] = at(centre);
            scene.add(Primitive::Circle {
                cx,
                cy,
                r,
                fill: fill.into(),
                fill_opacity: None,
                stroke: Some(stroke.into()),
                stroke_width: Some(1.0),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::drawing::DrawingFormat;

    fn tube(role: Role, inner_m: f64, outer_m: f64, z_m: [f64; 2]) -> Part {
        let axis_m = [0.013, 0.007];
        Part {
            role,
            body: Body::Tube {
                axis_m,
                inner_m,
                outer_m,
                z_m,
            },
            label: Some("7".to_owned()),
        }
    }

    fn array(section_y_m: f64) -> ArrayPlot {
        ArrayPlot {
            title: "a <b>".to_owned(),
            parts: vec![
                tube(Role::Winding, 0.012, 0.019, [-0.1, 0.0]),
                tube(Role::Core, 0.0, 0.011, [-0.11, 0.0]),
            ],
            section_y_m,
        }
    }

    #[test]
    fn a_cut_beside_the_bore_goes_through_one_piece_of_the_winding() {
        let body = array(0.007).parts[0].body.clone();
        let through = body.cut(0.007);
        assert_eq!(through.len(), 2);
        assert!((through[0][0] - (0.013 - 0.019)).abs() < 1e-12);
        assert!((through[1][0] - (0.013 + 0.012)).abs() < 1e-12);
        let beside = body.cut(0.007 + 0.015);
        let half = (0.019_f64.powi(2) - 0.015_f64.powi(2)).sqrt();
        assert_eq!(beside.len(), 1);
        assert!((beside[0][1] - 0.013 - half).abs() < 1e-12);
        assert!(body.cut(0.03).is_empty());
    }

    #[test]
    fn an_array_is_drawn_to_scale_in_every_format() {
        let plot = array(0.007);
        let svg = plot.drawing().svg();
        for text in [
            "z = 0",
            "from above",
            "steel core",
            "winding",
            "x / mm",
            ">7<",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("<b>") && !svg.contains("magnet"));
        let png = plot.drawing().bytes(DrawingFormat::Png).unwrap();
        assert!(png.starts_with(b"\x89PNG") && png.len() > 2000);
        let pdf = plot.drawing().bytes(DrawingFormat::Pdf).unwrap();
        assert!(pdf.starts_with(b"%PDF") && pdf.len() > 2000);
        assert_eq!(png, plot.drawing().bytes(DrawingFormat::Png).unwrap());
        assert_eq!(pdf, plot.drawing().bytes(DrawingFormat::Pdf).unwrap());
    }

    #[test]
    fn a_page_draws_the_same_with_its_own_colours() {
        let svg = array(0.007).markup(View::Section);
        assert_eq!(svg.matches("class=\"winding\"").count(), 2);
        assert!(!svg.contains("fill=") && !svg.contains("style="));
        assert_eq!(
            array(0.03).markup(View::Section).matches("winding").count(),
            0
        );
    }

    #[test]
    fn ticks_are_round() {
        let shown: Vec<String> = ticks([-0.11, 0.08]).into_iter().map(mm).collect();
        assert_eq!(shown, ["-100", "-50", "0", "50"]);
    }
}

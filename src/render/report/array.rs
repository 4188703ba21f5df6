//! An array on a page: from above and in section, without scripts.

use super::html::Html;
use crate::plot::array::{ArrayPlot, View};

/// Adds both views with these captions, below the names of what they show.
pub fn views(body: &mut Html, plot: &ArrayPlot, captions: [&str; 2]) {
    body.raw("<p class=\"key\">");
    for (name, class) in plot.legend() {
        body.raw(&format!("<svg class=\"array swatch\" viewBox=\"0 0 14 10\"><rect class=\"{class}\" width=\"14\" height=\"10\"/></svg>"))
            .text(name)
            .raw(" ");
    }
    body.raw("</p><div class=\"pair\">");
    for (view, caption) in [View::Plan, View::Section].into_iter().zip(captions) {
        body.raw("<figure>")
            .raw(&plot.markup(view))
            .element("figcaption", caption)
            .raw("</figure>");
    }
    body.raw("</div>");
}

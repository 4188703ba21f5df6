//! Parts of every page: head, policy, style, title, contents, data, script.

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::html::{Html, escaped};
use super::pack::{base64, in_script};

const STYLE: &str = include_str!("assets/style.css");
/// Read in this order; one script, so that names are shared.
const SCRIPTS: [&str; 7] = [
    include_str!("assets/base.js"),
    include_str!("assets/chart.js"),
    include_str!("assets/heat.js"),
    include_str!("assets/scene.js"),
    include_str!("assets/turn.js"),
    include_str!("assets/replay.js"),
    include_str!("assets/page.js"),
];

/// A part of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// Its markup.
    pub body: Html,
}

/// The last line of a page that this `version` made: it needs nothing else, and `more`.
#[must_use]
pub fn foot(version: &str, more: &str) -> String {
    format!("fluxform {version}. This page needs nothing but itself{more}.")
}

/// A page before it is put together.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// Kind of page.
    pub kind: &'static str,
    /// Its title.
    pub title: String,
    /// Markup that comes before all else.
    pub lead: Html,
    /// Its parts.
    pub sections: Vec<Section>,
    /// Data that the script draws.
    pub data: Value,
    /// The last line.
    pub foot: String,
}

impl Page {
    /// The whole page.
    #[must_use]
    pub fn html(self) -> String {
        let script = format!("(() => {{\n\"use strict\";\n{}}})();\n", SCRIPTS.concat());
        let policy = format!(
            "default-src 'none'; script-src '{}'; style-src '{}'; img-src data:; \
             base-uri 'none'; form-action 'none'",
            digest(&script),
            digest(STYLE),
        );
        let mut html = Html::default();
        html.raw("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n")
            .raw("<meta http-equiv=\"Content-Security-Policy\" content=\"")
            .raw(&policy)
            .raw("\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n")
            .raw("<meta name=\"color-scheme\" content=\"light dark\">\n<title>")
            .text(&self.title)
            .raw("</title>\n<style>")
            .raw(STYLE)
            .raw("</style>\n</head>\n<body>\n")
            .raw("<a class=\"skip\" href=\"#main\">Skip to the content</a>\n<header>\n");
        html.element("p class=\"kind\"", self.kind)
            .element("h1", &self.title)
            .raw(&self.lead.finish())
            .raw("</header>\n<nav aria-label=\"Parts of this page\"><ul>");
        for section in &self.sections {
            html.raw("<li><a href=\"#")
                .raw(section.id)
                .raw("\">")
                .text(section.title)
                .raw("</a></li>");
        }
        html.raw("</ul></nav>\n<main id=\"main\" tabindex=\"-1\">\n");
        for section in self.sections {
            let id = section.id;
            html.raw(&format!(
                "<section id=\"{id}\" aria-labelledby=\"{id}-h\">\n<h2 id=\"{id}-h\">{}</h2>\n",
                escaped(section.title)
            ));
            html.raw(&section.body.finish()).raw("\n</section>\n");
        }
        // A page whose drawings are in its text says nothing of scripts.
        let without_scripts = match &self.data {
            Value::Object(data) if data.is_empty() => "",
            _ => {
                "<noscript><p class=\"note\">The drawings need JavaScript; every number stands in \
                 the tables.</p></noscript>\n"
            }
        };
        html.raw("</main>\n<footer>")
            .text(&self.foot)
            .raw("</footer>\n<div id=\"tip\" hidden></div>\n")
            .raw("<p id=\"say\" class=\"hide\" aria-live=\"polite\"></p>\n")
            .raw(without_scripts)
            .raw("<script type=\"application/json\" id=\"data\">")
            .raw(&in_script(&self.data))
            .raw("</script>\n<script>")
            .raw(&script)
            .raw("</script>\n</body>\n</html>\n");
        with_distinct_clips(&html.finish())
    }
}

/// The page with clip paths of different names in different drawings: a browser takes the first of a name.
fn with_distinct_clips(page: &str) -> String {
    const NAME: &str = "kuva-clip-";
    const BEGINNING: &str = "<svg ";
    let mut drawings = page.split(BEGINNING);
    let mut all = drawings.next().unwrap_or("").to_owned();
    for (number, drawing) in drawings.enumerate() {
        all.push_str(BEGINNING);
        all.push_str(&drawing.replace(NAME, &format!("clip-{number}-")));
    }
    all
}

/// How a policy names a text that it lets in.
fn digest(text: &str) -> String {
    format!("sha256-{}", base64(&Sha256::digest(text.as_bytes())))
}

/// A drawing's place: an empty box that the script fills, with what it shows.
pub fn figure(html: &mut Html, id: &str, what: &str, caption: &str) {
    html.raw("<figure><div class=\"draw\" id=\"draw-")
        .raw(id)
        .raw("\" data-what=\"")
        .text(what)
        .raw("\"></div>")
        .element("figcaption", caption)
        .raw("</figure>");
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_page_lets_nothing_in_and_keeps_texts_as_texts() {
        let mut body = Html::default();
        body.text("<b>");
        let page = Page {
            kind: "Test",
            title: "</title><script>alert(1)</script>".to_owned(),
            lead: Html::default(),
            sections: vec![Section {
                id: "one",
                title: "One",
                body,
            }],
            data: json!({ "a": "</script>" }),
            foot: "<i>".to_owned(),
        };
        let html = page.clone().html();
        assert_eq!(html, page.html(), "not the same bytes twice");
        assert_eq!(html.matches("<script").count(), 2);
        assert_eq!(html.matches("</script>").count(), 2);
        assert!(!html.contains("<b>") && !html.contains("<i>"));
        assert!(html.contains("default-src 'none'") && !html.contains("unsafe-inline"));
        for outside in ["http://", "https://", " src=", "@import", "url("] {
            let own = html
                .replace("http://www.w3.org/2000/svg", "")
                .replace("url(#", "");
            assert!(!own.contains(outside), "{outside}");
        }
    }

    /// The second of two drawings was cut to the first one's rectangle.
    #[test]
    fn regression_drawings_of_one_page_shared_their_clip_paths() {
        let drawing =
            "<svg ><clipPath id=\"kuva-clip-0\"/><g clip-path=\"url(#kuva-clip-0)\"/></svg>";
        let page = with_distinct_clips(&format!("<main>{drawing}{drawing}</main>"));
        for own in ["clip-0-0", "clip-1-0"] {
            assert_eq!(page.matches(&format!("id=\"{own}\"")).count(), 1, "{page}");
            assert_eq!(page.matches(&format!("url(#{own})")).count(), 1, "{page}");
        }
    }

    #[test]
    fn no_asset_ends_its_element() {
        for text in SCRIPTS.iter().chain([&STYLE]) {
            let small = text.to_lowercase();
            assert!(!small.contains("</s") && !small.contains("<!--"), "{text}");
        }
    }
}

//! Links within and between the documents.

use std::collections::BTreeMap;

use fluxform_testing::root;

use crate::pages::{PAGES, page};
use fluxform_testing::needs::Trial;
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [the_readme_lists_its_sections_and_is_short, every_link_leads_somewhere],
    }
}

fn anchor(title: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let kept: String = title.to_lowercase().chars().filter(kept).collect();
    kept.replace(' ', "-")
}

/// The lines of a page outside its fenced blocks.
fn prose(page: &str) -> Vec<&str> {
    let mut fenced = false;
    page.lines()
        .filter(|line| {
            fenced ^= line.starts_with("```");
            !fenced && !line.starts_with("```")
        })
        .collect()
}

fn headings(text: &str) -> Vec<&str> {
    let lines = prose(text).into_iter();
    lines.filter(|line| line.starts_with("##")).collect()
}

fn the_readme_lists_its_sections_and_is_short() {
    let readme = page("README.md");
    assert!(
        readme.lines().count() <= 250,
        "it has {} lines",
        readme.lines().count()
    );
    let sections = headings(&readme);
    let sections = sections.iter().filter_map(|line| line.strip_prefix("## "));
    let expected: Vec<String> = sections
        .map(|title| format!("- [{title}](#{})", anchor(title)))
        .collect();
    let listed: Vec<&str> = readme
        .lines()
        .filter(|line| line.starts_with("- [") && line.contains("](#"))
        .collect();
    assert_eq!(listed, expected);
}

fn every_link_leads_somewhere() {
    let anchors: BTreeMap<&str, Vec<String>> = PAGES
        .iter()
        .map(|name| {
            let text = page(name);
            let all = headings(&text);
            let all = all
                .iter()
                .map(|line| anchor(line.trim_start_matches('#').trim_start()));
            (*name, all.collect())
        })
        .collect();
    let mut faults = Vec::new();
    for name in PAGES {
        let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
        for line in prose(&page(name)) {
            for link in line.split("](").skip(1) {
                let link = link.split(')').next().unwrap();
                if link.starts_with("http") {
                    continue;
                }
                let (file, to) = link.split_once('#').unwrap_or((link, ""));
                let mut path: Vec<&str> =
                    folder.split('/').filter(|part| !part.is_empty()).collect();
                for part in file.split('/').filter(|part| !part.is_empty()) {
                    if part == ".." {
                        path.pop();
                    } else {
                        path.push(part);
                    }
                }
                let path = if file.is_empty() {
                    name.to_owned()
                } else {
                    path.join("/")
                };
                let there = root().join(&path).exists();
                let titled = to.is_empty()
                    || anchors
                        .get(path.as_str())
                        .is_some_and(|all| all.iter().any(|it| it == to));
                if !there || !titled {
                    faults.push(format!("{name}: {link}"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

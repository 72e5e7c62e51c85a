//! The page around the sections.

use crate::run::ReportedRun;
use crate::scene::VIEWER;
use crate::{ReportError, compare, sections};
use tessera_outputs::html::escaped;

/// Of all pages of Tessera.
const STYLE: &str = include_str!("style.css");

/// The whole page: one run, or several side by side and then one after the other.
///
/// # Errors
/// Names the plot that could not be drawn.
pub fn page(runs: &[ReportedRun]) -> Result<String, ReportError> {
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let title = escaped(&names.join(", "));
    let mut body = String::new();
    if runs.len() > 1 {
        body.push_str(&format!("<header><h1>{} runs</h1></header>", runs.len()));
        body.push_str(&compare::html(runs)?);
    }
    for (place, run) in runs.iter().enumerate() {
        let level = if runs.len() > 1 { "h2" } else { "h1" };
        let class = if run.is_alarming { "badge alarm" } else { "badge" };
        let prefix = if runs.len() > 1 { format!("run{place}-") } else { String::new() };
        let reasons: String =
            run.reasons.iter().map(|reason| format!("<li>{}</li>", escaped(reason))).collect();
        let reasons =
            if reasons.is_empty() { reasons } else { format!("<ul class=\"reasons\">{reasons}</ul>") };
        body.push_str(&format!(
            "<article><header><{level}>{} <span class=\"{class}\">{}</span></{level}><p>{}</p>{reasons}</header>{}</article>",
            escaped(&run.name),
            escaped(&run.ended),
            escaped(&run.source),
            sections::of_run(run, &prefix)?
        ));
    }
    // It finds each run's data by itself.
    Ok(whole_page(&title, &body))
}

/// A page with this title, which needs nothing else: the style of all pages, and the script of the view in 3D
/// where there is one.
pub fn whole_page(title: &str, body: &str) -> String {
    let script = match body.contains("<canvas") {
        true => format!("<script>\n{VIEWER}</script>"),
        false => String::new(),
    };
    // No address of an icon, so that a browser does not go and look for one.
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <link rel=\"icon\" href=\"data:,\"><title>{title} · Tessera</title><style>{STYLE}</style></head>\n\
         <body><main>{body}</main>{script}</body></html>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Frame, Setting};

    fn run(name: &str, n: f64) -> ReportedRun {
        ReportedRun {
            name: name.into(),
            facts: vec![("ATE".into(), format!("{n} m"))],
            truth_m: vec![[0.0; 3], [n, 0.0, 0.0]],
            frames: vec![Frame { error_m: Some(n), ..Frame::default() }],
            settings: vec![Setting { key: "a.b".into(), value: n.to_string(), default: Some("1".into()) }],
            ..ReportedRun::default()
        }
    }

    #[test]
    fn one_run_has_every_section_and_nothing_from_elsewhere() {
        let page = page(&[run("<one>", 1.0)]).unwrap();
        for id in [
            "summary",
            "scene",
            "trajectory",
            "error",
            "worst",
            "graph",
            "latency",
            "memory",
            "events",
            "settings",
            "machine",
        ] {
            assert_eq!(page.matches(&format!("<section id=\"{id}\">")).count(), 1, "{id}");
        }
        assert!(page.contains("&lt;one&gt;") && !page.contains("<one>"));
        assert!(!page.contains("<script"), "nothing to draw in 3D");
        assert!(!page.contains("src=\"http") && !page.contains("url("));
        assert!(page.contains("All settings are those of the default"));
    }

    #[test]
    fn the_script_of_the_view_in_3d_is_there_once() {
        let scene = crate::ReportScene {
            frames: vec![crate::SceneFrame::default()],
            ..crate::ReportScene::default()
        };
        let with = |name: &str| ReportedRun { scene: Some(scene.clone()), ..run(name, 1.0) };
        let page = page(&[with("one"), with("two")]).unwrap();
        assert_eq!((page.matches("<canvas").count(), page.matches(VIEWER).count()), (2, 1));
        assert_eq!(page.matches("<script").count(), 3);
    }

    #[test]
    fn several_runs_are_compared_first() {
        let page = page(&[run("one", 1.0), run("two", 2.0)]).unwrap();
        let compared = page.split("<article>").next().unwrap();
        assert!(compared.contains("1 m") && compared.contains("2 m"), "{compared}");
        assert!(compared.contains("<td>a.b</td><td>1</td><td>2</td>"), "{compared}");
        assert!(page.contains("id=\"run1-graph\"") && page.contains("what differs from the default"));
    }

    #[test]
    fn a_run_of_nothing_has_a_page() {
        assert!(page(&[ReportedRun::default()]).unwrap().contains("</html>"));
    }
}

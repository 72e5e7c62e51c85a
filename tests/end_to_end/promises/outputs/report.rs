//! The report: a page of what a run directory holds, which changes nothing and needs nothing.

use crate::common::{Run, room};
use crate::requirements::missing;
use std::path::{Path, PathBuf};
use std::process::Command;

const SECTIONS: [&str; 11] = [
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
];

fn report(arguments: &[&Path]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).arg("report").args(arguments).output().unwrap()
}

fn page(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn a_run_leaves_a_report_that_needs_nothing_else() {
    let run = room().with(&["--set", "surface.filter_rings=1"]);
    assert!(run.finish().success());
    let first = page(&run.out().join("report.html"));
    for id in SECTIONS {
        assert_eq!(first.matches(&format!("<section id=\"{id}\">")).count(), 1, "{id}");
    }
    assert_eq!(first.matches("<script").count(), 2, "the data of the view in 3D, and what draws them");
    for word in ["<script src", "src=\"http", "fetch(", "href=\"http", "url(", "@import"] {
        assert!(!first.contains(word), "{word}");
    }
    assert!(first.contains("surface.filter_rings"), "what differs from the default is told");
    assert!(first.contains("data:image/jpeg;base64,") && first.contains("data:image/png;base64,"));

    let before = crate::common::OUTPUTS.map(|name| run.output(name));
    assert!(report(&[&run.out()]).status.success());
    assert_eq!(page(&run.out().join("report.html")), first, "a function of the run directory");
    assert!(crate::common::OUTPUTS.map(|name| run.output(name)) == before);
}

#[test]
fn a_report_can_be_declined_and_made_later() {
    let run = room().frames(6).with(&["--set", "output.report=false"]);
    assert!(run.finish().success());
    assert!(!run.out().join("report.html").exists());
    let output = report(&[&run.out()]);
    assert!(output.status.success());
    let path = run.out().join("report.html");
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), path.display().to_string());
    assert!(page(&path).contains("</html>"));
}

#[test]
fn runs_stand_side_by_side() {
    let (one, other) = (room().frames(8), room().frames(12).with(&["--set", "surface.step=4"]));
    assert!(one.finish().success() && other.finish().success());
    let path = one.dir.path().join("both.html");
    assert!(report(&[&one.out(), &other.out(), Path::new("--out"), &path]).status.success());
    let page = page(&path);
    assert!(page.contains("<td>frames processed</td><td>8 of 8</td><td>12 of 12</td>"));
    assert!(page.contains("<td>surface.step</td><td>2</td><td>4</td>"));
}

#[test]
fn deaths_are_told_and_a_recording_that_is_gone_too() {
    let run = room().frames(6).with_faults("align=stored:0");
    assert!(run.finish().success());
    let path = run.out().join("report.html");
    assert!(page(&path).contains("align died: signal 9"), "{}", run.log());
    // The folder that the configuration names is not there any more.
    let config = String::from_utf8(run.output("config.toml")).unwrap();
    assert!(config.contains("source = \"room\""), "{config}");
    let config = config.replace("source = \"room\"", "source = \"/no/where\"");
    std::fs::write(run.out().join("config.toml"), config).unwrap();
    assert!(report(&[&run.out()]).status.success());
    let page = page(&path);
    assert!(page.contains("No pictures: the recording cannot be opened"));
    assert!(!page.contains("data:image/jpeg"));
}

#[test]
fn a_run_that_does_not_exist_is_named() {
    let output = report(&[Path::new("no-such-run")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no run \"no-such-run\""));
}

/// At the head of a copy of the page: errors of its scripts, of what it loads and of its rules, and what it
/// writes to the console as an error. What the browser has to say of the graphics card is none of them.
const LISTEN: &str = "<head><script>
{
  const complain = words => document.documentElement.dataset.complaints =
    (document.documentElement.dataset.complaints ?? '') + `complaint: ${words}; `;
  addEventListener('error', e => complain(e.message ?? `cannot load ${e.target.outerHTML}`), true);
  addEventListener('unhandledrejection', e => complain(e.reason));
  addEventListener('securitypolicyviolation', e => complain(e.violatedDirective));
  console.error = (...words) => complain(words.join(' '));
}
</script>";

/// Appended to a copy of the page: says of each section and plot how large it is drawn.
const MEASURE: &str = "<script>
const lines = [...document.querySelectorAll('section')].map(s => {
  const shown = [...s.querySelectorAll('svg')].filter(v => v.getBoundingClientRect().height > 60).length;
  const broken = [...s.querySelectorAll('img')].filter(i => i.naturalWidth == 0).length;
  return `section ${s.id} height ${Math.round(s.getBoundingClientRect().height)} plots ${shown} broken ${broken};`;
});
lines.push(`overflow ${document.documentElement.scrollWidth - window.innerWidth};`);
document.body.dataset.measured = lines.join(' ');
</script>";

fn browser() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&folders).collect();
    names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name))).find(|path| path.is_file())
}

/// What the browser made of the page in a window of that width: its complaints and its measures.
fn open(browser: &Path, folder: &Path, html: &str, width: u32) -> (String, String) {
    let path = folder.join("measured.html");
    assert!(html.contains("<head>"));
    let html = html.replacen("<head>", LISTEN, 1);
    std::fs::write(&path, format!("{html}{MEASURE}")).unwrap();
    let output = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("--window-size={width},900"))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let written = |name: &str| {
        let value = dom.split_once(&format!("data-{name}=\"")).and_then(|(_, rest)| rest.split_once('"'));
        value.map_or(String::new(), |(words, _)| words.to_owned())
    };
    assert!(!written("measured").is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    (written("complaints"), written("measured"))
}

fn number(measured: &str, section: &str, what: &str) -> i64 {
    let own =
        measured.split(';').find(|part| part.contains(&format!("section {section} "))).unwrap_or_default();
    let mut words = own.split_whitespace().skip_while(|word| *word != what);
    words.nth(1).and_then(|word| word.parse().ok()).unwrap_or(-1)
}

#[test]
fn a_browser_draws_every_section_on_wide_and_narrow_screens() {
    let Some(browser) = browser() else {
        missing("browser", "no chromium in PATH (Debian: apt-get install chromium)");
        return;
    };
    let run: Run = room();
    assert!(run.finish().success());
    let html = page(&run.out().join("report.html"));
    for width in [1100, 500] {
        let (complaints, measured) = open(&browser, run.dir.path(), &html, width);
        assert_eq!(complaints, "", "at {width}");
        for (section, plots) in SECTIONS.map(|section| match section {
            "trajectory" | "latency" => (section, 2),
            "error" | "graph" | "memory" => (section, 1),
            _ => (section, 0),
        }) {
            assert!(number(&measured, section, "height") > 50, "{section} at {width}: {measured}");
            assert_eq!(number(&measured, section, "plots"), plots, "{section} at {width}: {measured}");
            assert_eq!(number(&measured, section, "broken"), 0, "{section} at {width}: {measured}");
        }
        assert!(measured.contains("overflow 0;") || measured.contains("overflow -"), "{width}: {measured}");
    }
}

#[test]
fn a_page_is_judged_by_its_errors_and_not_by_its_warnings() {
    let Some(browser) = browser() else {
        missing("browser", "no chromium in PATH (Debian: apt-get install chromium)");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let complaints = |body: &str| {
        let page = format!("<!DOCTYPE html><html><head></head><body>{body}</body></html>");
        open(&browser, folder.path(), &page, 500).0
    };
    assert_eq!(
        complaints("<script>console.warn('GPU stall due to ReadPixels'); console.log('on')</script>"),
        ""
    );
    let errors = [
        "<script>throw new Error('of a script')</script>",
        "<script>console.error('of a script')</script>",
        "<script>this is no script</script>",
        "<img src=\"absent.png\" alt=\"of a script\">",
    ];
    for body in errors {
        assert!(complaints(body).contains("complaint: "), "{body}");
    }
}

#[test]
fn on_paper_it_takes_few_pages_and_keeps_its_marks() {
    let Some(browser) = browser() else {
        missing("browser", "no chromium in PATH (Debian: apt-get install chromium)");
        return;
    };
    let run: Run = room();
    assert!(run.finish().success());
    let (pdf, html) = (run.dir.path().join("report.pdf"), run.out().join("report.html"));
    let output = Command::new(&browser)
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"])
        .arg(format!("--user-data-dir={}", run.dir.path().join("profile").display()))
        .arg(format!("--print-to-pdf={}", pdf.display()))
        .arg(format!("file://{}", html.display()))
        .output()
        .unwrap();
    let bytes = std::fs::read(&pdf).unwrap_or_else(|error| panic!("{error}: {output:?}"));
    let n_pages = bytes.windows(12).filter(|word| word == b"/Type /Page\n").count();
    assert!((3..=6).contains(&n_pages), "{n_pages} pages");
    // Without this, browsers leave out the letters of the frames and the colours of the legends.
    assert!(page(&html).contains("figcaption i { print-color-adjust: exact;"));
}

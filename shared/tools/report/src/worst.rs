//! Frames to look at: one row of pictures each.

use crate::run::ReportedRun;
use tessera_outputs::html::escaped;

/// Letter of the n-th frame to look at, in plots and beside its pictures.
pub(crate) fn letter(place: usize) -> String {
    ('A'..='Z').cycle().nth(place).unwrap_or('A').to_string()
}

/// The pictures, or why there are none.
pub(crate) fn html(run: &ReportedRun) -> String {
    let mut out = String::new();
    for (place, worst) in run.worst.iter().enumerate() {
        out.push_str(&format!(
            "<div class=\"worst\"><h4><b class=\"letter\">{}</b> frame {}: {}</h4>",
            letter(place),
            worst.index,
            escaped(&worst.words)
        ));
        if !worst.pictures.is_empty() {
            out.push_str("<div class=\"pictures\">");
            for (what, image) in &worst.pictures {
                let name = escaped(what);
                out.push_str(&format!("<div>{}<small>{name}</small></div>", image.html(what)));
            }
            out.push_str("</div>");
        }
        out.push_str("</div>");
    }
    if let Some(reason) = &run.no_pictures {
        out.push_str(&format!("<p class=\"note\">No pictures: {}</p>", escaped(reason)));
    }
    out
}

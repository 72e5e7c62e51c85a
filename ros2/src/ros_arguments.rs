//! Arguments as launch files of ROS 2 give them, `--ros-args -r FROM:=TO -p NAME:=VALUE --params-file FILE`,
//! as the program's own: a parameter is the option of that name.

use std::ffi::OsString;

const BEGIN: &str = "--ros-args";
const END: &str = "--";
/// Behind it stand arguments of the run.
const RUN: &str = "--";
/// Names of the node itself among the remapped ones.
const NAMESPACE: &str = "__ns";
const NODE: &str = "__node";
const OWN_NAME: &str = "tessera";
/// Above the parameters in a file of them.
const IN_FILE: &str = "ros__parameters:";

/// The words with those of ROS taken out, and what they mean put behind the program's own options.
///
/// # Errors
/// In words, where something is none of ROS's forms, or has no meaning here.
pub(crate) fn as_own(words: Vec<OsString>) -> Result<Vec<OsString>, String> {
    let own_end = words.iter().position(|word| word == RUN).unwrap_or(words.len());
    let Some(begin) = words[..own_end].iter().position(|word| word == BEGIN) else { return Ok(words) };
    let end = words[begin..].iter().position(|word| word == END).map_or(words.len(), |n| begin + n);
    let mut made = Made::default();
    let mut given = words[begin + 1..end].iter().map(|word| word.to_string_lossy().into_owned());
    while let Some(word) = given.next() {
        let mut value = || given.next().ok_or_else(|| format!("{word} of {BEGIN} has no value"));
        match word.as_str() {
            "-r" | "--remap" => made.remap(&value()?)?,
            "-p" | "--param" => {
                let value = value()?;
                let (name, value) = pair(&value, ":=")?;
                made.parameter(name, value)?;
            }
            "--params-file" => made.file(&value()?)?,
            BEGIN => {}
            // Of logging: this program has one way to tell.
            "--log-level" | "--log-config-file" => drop(value()?),
            other if other.contains("-log") || other.contains("-rosout") => {}
            other => return Err(format!("{other} among {BEGIN}: expected -r, -p or --params-file")),
        }
    }
    let mut all = words[..begin].to_vec();
    all.extend(made.options().into_iter().map(OsString::from));
    // One END closes the words of ROS, and the next one begins those of the run.
    let rest = words.get(end + 1..).unwrap_or_default();
    if rest.first().is_some_and(|word| word == RUN) || rest.is_empty() {
        all.extend_from_slice(rest);
    } else {
        all.push(RUN.into());
        all.extend_from_slice(rest);
    }
    Ok(all)
}

#[derive(Default)]
struct Made {
    options: Vec<String>,
    namespace: Option<String>,
    node: Option<String>,
}

impl Made {
    fn remap(&mut self, rule: &str) -> Result<(), String> {
        match pair(rule, ":=")? {
            (NAMESPACE, to) => self.namespace = Some(to.trim_end_matches('/').to_owned()),
            (NODE, to) => self.node = Some(to.to_owned()),
            _ => self.options.extend(["--remap".to_owned(), rule.to_owned()]),
        }
        Ok(())
    }

    fn parameter(&mut self, name: &str, value: &str) -> Result<(), String> {
        let value = value.trim_matches(['"', '\'']);
        let is_name = name.starts_with(|c: char| c.is_ascii_lowercase())
            && name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        if !is_name {
            return Err(format!("parameter {name:?}: expected the name of an option, as use_sim_time"));
        }
        let option = format!("--{}", name.replace('_', "-"));
        match value {
            "true" | "True" => self.options.push(option),
            // Empty is what was not given, as `ros2 param dump` writes it.
            "false" | "False" | "" => {}
            _ => self.options.push(format!("{option}={value}")),
        }
        Ok(())
    }

    /// A file as launch files write it: parameters of any node, one a line.
    fn file(&mut self, path: &str) -> Result<(), String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("cannot read {path}: {error}"))?;
        let mut above: Option<usize> = None;
        for line in text.lines() {
            let words = line.split(" #").next().unwrap_or_default().trim();
            if words.is_empty() || words.starts_with('#') || words == "---" {
                continue;
            }
            let indent = line.len() - line.trim_start().len();
            if words == IN_FILE {
                above = Some(indent);
            } else if above.is_some_and(|above| indent > above) {
                let (name, value) = pair(words, ":").map_err(|why| format!("{path}: {why}"))?;
                self.parameter(name, value.trim()).map_err(|why| format!("{path}: {why}"))?;
            } else {
                above = None;
            }
        }
        Ok(())
    }

    fn options(self) -> Vec<String> {
        let mut options = self.options;
        if self.namespace.is_some() || self.node.is_some() {
            let node = self.node.unwrap_or_else(|| OWN_NAME.to_owned());
            options.push(format!("--namespace={}/{node}", self.namespace.unwrap_or_default()));
        }
        options
    }
}

fn pair<'a>(text: &'a str, by: &str) -> Result<(&'a str, &'a str), String> {
    text.split_once(by).ok_or_else(|| format!("{text:?}, expected NAME{by}VALUE"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(text: &str) -> Result<String, String> {
        let words = text.split(' ').map(OsString::from).collect();
        as_own(words).map(|words| words.join(" ".as_ref()).into_string().unwrap())
    }

    #[test]
    fn words_of_ros_are_options() {
        for (given, expected) in [
            ("t desk --run -- --out x", "t desk --run -- --out x"),
            ("t desk --ros-args -r /tf:=/a/tf", "t desk --remap /tf:=/a/tf"),
            ("t desk --ros-args -r __ns:=/robot1", "t desk --namespace=/robot1/tessera"),
            ("t desk --ros-args -r __node:=slam -r __ns:=/", "t desk --namespace=/slam"),
            (
                "t desk --run --ros-args -p use_sim_time:=true -p base_frame:=base -p no_tf:=false -- -- --out x",
                "t desk --run --use-sim-time --base-frame=base -- --out x",
            ),
            ("t desk --run --ros-args --log-level info -- --out x", "t desk --run -- --out x"),
        ] {
            assert_eq!(own(given).unwrap(), expected, "{given}");
        }
        for (given, words) in [
            ("t desk --ros-args -p", "no value"),
            ("t desk --ros-args -p a=b", "expected NAME:=VALUE"),
            ("t desk --ros-args -p qos_overrides./tf:=x", "expected the name of an option"),
            ("t desk --ros-args --what", "expected -r, -p"),
            ("t desk --ros-args --params-file no/such.yaml", "no/such.yaml"),
        ] {
            assert!(own(given).unwrap_err().contains(words), "{given}");
        }
    }

    #[test]
    fn a_file_of_parameters_is_read_as_launch_files_write_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("params.yaml");
        let text = "# made by launch\n/**:\n  ros__parameters:\n    use_sim_time: true\n    map_spacing: 0.1 # m\n    base_frame: 'base'\nother:\n  what: 1\n";
        std::fs::write(&path, text).unwrap();
        let found = own(&format!("t desk --ros-args --params-file {}", path.display())).unwrap();
        assert_eq!(found, "t desk --use-sim-time --map-spacing=0.1 --base-frame=base");
    }
}

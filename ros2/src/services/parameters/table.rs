//! The parameters: options of the command line by their names, with the help of each as its description.

use super::wire::{ParameterDescriptor, ParameterValue};
use crate::arguments::Ros2Arguments;
use clap::CommandFactory;

/// A parameter as it was given or by default.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NodeParameter {
    /// As in launch files: that of the option, with `_`.
    pub(crate) name: String,
    content: ParameterContent,
    description: String,
}

/// What an option may be. A text that is empty was not given: a file of parameters that `ros2 param dump`
/// wrote is read back as it was.
#[derive(Clone, Debug, PartialEq)]
enum ParameterContent {
    Flag(bool),
    Number(f64),
    Text(String),
}

impl NodeParameter {
    /// All parameters of the node, in the order of their names.
    pub(crate) fn all(arguments: &Ros2Arguments) -> Vec<Self> {
        let text = |given: &Option<String>| ParameterContent::Text(given.clone().unwrap_or_default());
        let (low, high) = arguments.grid_heights;
        let contents = [
            ("base_frame", ParameterContent::Text(arguments.base_frame.clone())),
            ("camera", text(&arguments.camera)),
            ("camera_info", text(&arguments.camera_info)),
            ("color_topic", text(&arguments.color_topic)),
            ("depth_topic", text(&arguments.depth_topic)),
            ("grid_cell", ParameterContent::Number(arguments.grid_cell)),
            ("grid_heights", ParameterContent::Text(format!("{low},{high}"))),
            ("grid_topic", ParameterContent::Text(arguments.grid_topic())),
            ("imu_topic", text(&arguments.imu_topic)),
            ("map_spacing", ParameterContent::Number(arguments.map_spacing)),
            ("no_color", ParameterContent::Flag(arguments.no_color)),
            ("no_tf", ParameterContent::Flag(arguments.no_tf)),
            ("quiet", ParameterContent::Flag(arguments.quiet)),
            ("reliable", ParameterContent::Flag(arguments.reliable)),
            ("use_sim_time", ParameterContent::Flag(arguments.use_sim_time)),
        ];
        let command = Ros2Arguments::command();
        let described = |id: &str| {
            let option = command.get_arguments().find(|option| option.get_id() == id);
            option.and_then(|option| option.get_help()).map(ToString::to_string).unwrap_or_default()
        };
        let all = contents.map(|(name, content)| Self {
            name: name.to_owned(),
            content,
            description: described(name),
        });
        all.into()
    }

    pub(super) fn value(&self) -> ParameterValue {
        match &self.content {
            ParameterContent::Flag(flag) => ParameterValue::flag(*flag),
            ParameterContent::Number(number) => ParameterValue::number(*number),
            ParameterContent::Text(text) => ParameterValue::text(text.clone()),
        }
    }

    /// As `ros2 param dump` writes it.
    #[cfg(test)]
    pub(super) fn in_yaml(&self) -> String {
        match &self.content {
            ParameterContent::Flag(flag) => flag.to_string(),
            ParameterContent::Number(number) => number.to_string(),
            ParameterContent::Text(text) if text.is_empty() => "''".to_owned(),
            ParameterContent::Text(text) => text.clone(),
        }
    }

    pub(super) fn described(&self) -> ParameterDescriptor {
        ParameterDescriptor::of(&self.name, self.value().kind, self.description.clone())
    }
}

//! Where Rerun's data go: a viewer or a file, with the layout that it opens in.

use crate::arguments::RerunArguments;
use crate::blueprint::blueprint;
use crate::error::ViewError;
use crate::find::ViewedRun;
use re_sdk::{RecordingStream, RecordingStreamBuilder, SpawnOptions};

/// Memory of the server inside an opened viewer.
const SERVER_MEMORY: &str = "512MiB";

/// Opens the output; its blueprint goes first.
pub(crate) fn open(arguments: &RerunArguments, run: &ViewedRun) -> Result<RecordingStream, ViewError> {
    let builder = RecordingStreamBuilder::new("tessera")
        .recording_name(run.file.name.as_str())
        .with_default_blueprint(blueprint());
    let recording = match (&arguments.save, &arguments.connect) {
        (Some(path), _) => builder.save(path),
        (None, Some(url)) => builder.connect_grpc_opts(url.as_str()),
        (None, None) => builder.spawn_opts(&SpawnOptions {
            memory_limit: arguments.memory.clone(),
            server_memory_limit: SERVER_MEMORY.to_owned(),
            hide_welcome_screen: true,
            ..SpawnOptions::default()
        }),
    };
    recording.map_err(ViewError::output)
}

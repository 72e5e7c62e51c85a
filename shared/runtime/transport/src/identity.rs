//! Place of a run's shared memory: a private folder and a prefix of its own.

use crate::cleanup::SHARED_MEMORY;
use crate::error::TransportError;
use iceoryx2::prelude::{Config, FileName, FilePath, Path as IoxPath, SemanticString};
use std::fs::DirBuilder;
use std::io::Read;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// The part of shared memory that belongs to one run alone.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RunIdentity {
    /// iceoryx2's root: nodes and services. No Tessera process opens a file below it, except
    /// through iceoryx2: opening and closing one would make a living node look dead.
    pub root: PathBuf,
    /// Beginning of all names in /dev/shm, at most 8 characters.
    pub prefix: String,
    /// iceoryx2's configuration for this run, beside the root.
    pub config_file: PathBuf,
}

impl RunIdentity {
    /// Makes a new root, and the configuration that every process of the run loads.
    ///
    /// # Errors
    /// Where the private folder is not private or cannot be made.
    pub(crate) fn create() -> Result<Self, TransportError> {
        let base = private_folder()?;
        for _ in 0..100 {
            let prefix = random_word(&base)?;
            let root = base.join(&prefix);
            match DirBuilder::new().mode(0o700).create(&root) {
                Ok(()) => {
                    let identity = Self::of(&base, &prefix);
                    identity.write_config()?;
                    return Ok(identity);
                }
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(TransportError::io("make", &root)(error)),
            }
        }
        Err(TransportError::NotPrivate { path: base, problem: "holds every name that was tried".into() })
    }

    /// The identity of this prefix; nothing is made.
    pub(crate) fn of(base: &Path, prefix: &str) -> Self {
        let config_file = base.join(format!("{prefix}.toml"));
        Self { root: base.join(prefix), prefix: prefix.to_owned(), config_file }
    }

    /// Whether a word may be a prefix.
    pub(crate) fn is_prefix(word: &str) -> bool {
        word.len() == 8 && word.bytes().all(|b| b.is_ascii_alphanumeric())
    }

    fn write_config(&self) -> Result<(), TransportError> {
        let wrong =
            |reason: String| TransportError::Open { what: "a configuration of iceoryx2".into(), reason };
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes())
            .map_err(|e| wrong(format!("{e:?}: prefix {}", self.prefix)))?;
        let root = IoxPath::new(self.root.as_os_str().as_encoded_bytes())
            .map_err(|e| wrong(format!("{e:?}: root {}", self.root.display())))?;
        config.global.set_root_path(&root);
        // One process cleans up, the supervisor (`Link::clean_dead_nodes`). A stage that did it too
        // would start later, and leave a lock for good when it is killed meanwhile.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let text = toml::to_string(&config).map_err(|e| wrong(e.to_string()))?;
        std::fs::write(&self.config_file, text).map_err(TransportError::io("write", &self.config_file))
    }

    /// Whether the run has not been cleared away: its configuration is the first that goes.
    pub(crate) fn is_there(&self) -> bool {
        self.config_file.exists()
    }

    /// Loads the run's configuration, also as the global one: where iceoryx2 falls back to that,
    /// it must find this run and no other.
    pub(crate) fn load(&self) -> Result<Config, TransportError> {
        let wrong = |reason: String| TransportError::Open {
            what: format!("the configuration {}", self.config_file.display()),
            reason,
        };
        let path = FilePath::new(self.config_file.as_os_str().as_encoded_bytes())
            .map_err(|e| wrong(format!("{e:?}")))?;
        let config = Config::from_file(&path).map_err(|e| wrong(format!("{e:?}")))?;
        let _ = Config::setup_global_config_from_file(&path);
        Ok(config)
    }
}

/// Where the user's private folder for runs lies: `$XDG_RUNTIME_DIR/tessera` or
/// `/dev/shm/tessera-<uid>`.
///
/// In memory either way: iceoryx2 syncs the files that it makes below it, and on a busy disk each
/// of the dozen syncs of a starting stage takes up to 50 ms. It also makes sockets there, whose
/// paths must stay short; a long XDG_RUNTIME_DIR is not used.
fn private_path() -> PathBuf {
    const LONGEST: usize = 30;
    let uid = rustix::process::getuid().as_raw();
    std::env::var_os("XDG_RUNTIME_DIR")
        .map(PathBuf::from)
        .filter(|dir| dir.is_absolute() && dir.is_dir() && dir.as_os_str().len() <= LONGEST)
        .map_or_else(|| Path::new(SHARED_MEMORY).join(format!("tessera-{uid}")), |dir| dir.join("tessera"))
}

/// The user's private folder for runs, made where it is missing.
pub(crate) fn private_folder() -> Result<PathBuf, TransportError> {
    let base = private_path();
    loop {
        match DirBuilder::new().mode(0o700).create(&base) {
            Ok(()) => {}
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(TransportError::io("make", &base)(error)),
        }
        // Where the last run that was in it has just removed it, once more.
        if let Some(base) = existing_private_folder()? {
            return Ok(base);
        }
    }
}

/// The same where it is there; `None` where no run of this user is going on.
pub(crate) fn existing_private_folder() -> Result<Option<PathBuf>, TransportError> {
    let base = private_path();
    let is_there = check_private(&base, rustix::process::getuid().as_raw())?;
    Ok(is_there.then_some(base))
}

/// Refuses a folder that another user owns or may read, or that is a link; false where there is none.
fn check_private(path: &Path, uid: u32) -> Result<bool, TransportError> {
    let meta = match std::fs::symlink_metadata(path) {
        Ok(meta) => meta,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(TransportError::io("look at", path)(error)),
    };
    let problem = if !meta.is_dir() {
        "is no folder".to_string()
    } else if meta.uid() != uid {
        format!("belongs to uid {}, expected {uid}", meta.uid())
    } else if meta.mode() & 0o077 != 0 {
        format!("has mode {:o}, expected 700", meta.mode() & 0o777)
    } else {
        return Ok(true);
    };
    Err(TransportError::NotPrivate { path: path.into(), problem })
}

/// Eight random letters and digits.
fn random_word(base: &Path) -> Result<String, TransportError> {
    let mut bytes = [0u8; 8];
    std::fs::File::open("/dev/urandom")
        .and_then(|mut file| file.read_exact(&mut bytes))
        .map_err(TransportError::io("read random bytes for", base))?;
    const LETTERS: &[u8; 32] = b"abcdefghijkmnopqrstuvwxyz2345678";
    Ok(bytes.iter().filter_map(|byte| LETTERS.get(usize::from(byte % 32))).copied().map(char::from).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_folder_that_others_can_read_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let uid = rustix::process::getuid().as_raw();
        let set_mode = |mode| {
            std::fs::set_permissions(dir.path(), std::fs::Permissions::from_mode(mode)).unwrap();
        };
        set_mode(0o755);
        assert!(check_private(dir.path(), uid).unwrap_err().to_string().contains("mode 755"));
        set_mode(0o700);
        assert!(check_private(dir.path(), uid).unwrap());
        assert!(!check_private(&dir.path().join("none"), uid).unwrap());
        assert!(check_private(dir.path(), uid + 1).unwrap_err().to_string().contains("belongs to uid"));
        let link = dir.path().join("link");
        std::os::unix::fs::symlink("/tmp", &link).unwrap();
        assert!(check_private(&link, uid).unwrap_err().to_string().contains("is no folder"));
    }
}

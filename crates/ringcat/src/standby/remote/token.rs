//! The token of a client: the bytes of a file that only its owner can read.

use std::error::Error;
use std::fmt;
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use ringcat_link::process::{effective_user, open_at_once};

/// Shortest token, in bytes.
const SHORTEST: usize = 16;
/// Longest one.
const LONGEST: usize = 256;
/// Bits of a file mode that give rights to others.
const OTHERS: u32 = 0o077;

/// A token of 16 to 256 printable ASCII characters.
#[derive(Clone)]
pub struct RemoteToken(String);

/// Why there is no token.
#[derive(Debug)]
#[non_exhaustive]
pub enum TokenError {
    /// The file cannot be read.
    File(io::Error),
    /// Others than its owner have rights to the file.
    Readable {
        /// Its mode.
        mode: u32,
    },
    /// The file belongs neither to the user of this process nor to root.
    Owner {
        /// Number of that user.
        user: u32,
    },
    /// It is too short, too long, or has other characters.
    Content,
}

impl fmt::Display for TokenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TokenError::File(error) => error.fmt(f),
            TokenError::Readable { mode } => {
                write!(f, "others may read it (mode {:03o}): chmod 600", mode & 0o777)
            }
            TokenError::Owner { user } => write!(f, "it belongs to user {user}, neither to the own one nor to root"),
            TokenError::Content => {
                write!(f, "expected {SHORTEST} to {LONGEST} printable ASCII characters (openssl rand -hex 32)")
            }
        }
    }
}

impl Error for TokenError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            TokenError::File(error) => Some(error),
            TokenError::Readable { .. } | TokenError::Owner { .. } | TokenError::Content => None,
        }
    }
}

impl RemoteToken {
    /// From its characters.
    ///
    /// # Errors
    /// [`TokenError::Content`].
    pub fn new(token: &str) -> Result<RemoteToken, TokenError> {
        let is_right = (SHORTEST..=LONGEST).contains(&token.len()) && token.bytes().all(|byte| byte.is_ascii_graphic());
        if is_right { Ok(RemoteToken(token.to_owned())) } else { Err(TokenError::Content) }
    }

    /// From a regular file of the own user or root, to which only its owner has rights. White space around the token is
    /// left out.
    ///
    /// # Errors
    /// [`TokenError`].
    pub fn from_file(path: &Path) -> Result<RemoteToken, TokenError> {
        // Opened once: what is checked is what is read.
        let file = open_at_once(path).map_err(TokenError::File)?;
        let about = file.metadata().map_err(TokenError::File)?;
        if !about.is_file() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file");
            return Err(TokenError::File(error));
        }
        if about.mode() & OTHERS != 0 {
            return Err(TokenError::Readable { mode: about.mode() });
        }
        let own = effective_user();
        if ![0, own].contains(&about.uid()) {
            return Err(TokenError::Owner { user: about.uid() });
        }
        let mut text = String::new();
        file.take(2 * LONGEST as u64).read_to_string(&mut text).map_err(TokenError::File)?;
        RemoteToken::new(text.trim())
    }

    /// Whether a token is this one. The time that it takes does not depend on the bytes.
    pub(super) fn is(&self, other: &str) -> bool {
        let (own, other) = (self.0.as_bytes(), other.as_bytes());
        let differs = own.iter().enumerate().fold(0, |differs, (at, byte)| {
            differs | (byte ^ std::hint::black_box(other.get(at).copied().unwrap_or(!byte)))
        });
        std::hint::black_box(differs) == 0 && own.len() == other.len()
    }

    pub(super) fn text(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for RemoteToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RemoteToken(..)")
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    // covers: AC-08, standby
    #[test]
    fn a_token_is_compared_as_a_whole_and_never_printed() {
        let token = RemoteToken::new("0123456789abcdef").expect("it is long enough");
        assert!(token.is("0123456789abcdef"));
        for other in ["", "0123456789abcde", "0123456789abcdeF", "0123456789abcdef0", "1123456789abcdef"] {
            assert!(!token.is(other), "{other}");
        }
        assert_eq!(format!("{token:?}"), "RemoteToken(..)");
        for wrong in ["0123456789abcde", "0123456789 abcdef", &"x".repeat(257)] {
            assert!(matches!(RemoteToken::new(wrong), Err(TokenError::Content)), "{wrong}");
        }
    }

    // covers: AC-08, standby
    #[test]
    fn a_file_that_others_can_read_is_no_token() {
        let path = std::env::temp_dir().join(format!("ringcat-token-{}", std::process::id()));
        fs::write(&path, "0123456789abcdef\n").expect("the folder is there");
        let mode = |mode| fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("it is ours");
        mode(0o640);
        let refused = RemoteToken::from_file(&path).expect_err("others can read it");
        assert!(refused.to_string().contains("mode 640"), "{refused}");
        mode(0o600);
        assert!(RemoteToken::from_file(&path).is_ok_and(|token| token.is("0123456789abcdef")));
        // Only root can give a file away.
        if std::os::unix::fs::chown(&path, Some(65_534), None).is_ok() && effective_user() == 0 {
            let of_another = RemoteToken::from_file(&path);
            assert!(matches!(of_another, Err(TokenError::Owner { user: 65_534 })), "{of_another:?}");
        }
        fs::remove_file(&path).expect("it is there");
        assert!(matches!(RemoteToken::from_file(&path), Err(TokenError::File(_))));
    }

    // covers: AC-08, standby
    #[test]
    fn a_pipe_is_no_token_and_its_writer_is_not_awaited() {
        let path = std::env::temp_dir().join(format!("ringcat-token-pipe-{}", std::process::id()));
        let made = std::process::Command::new("mkfifo").args(["-m", "600"]).arg(&path).status();
        assert!(made.is_ok_and(|made| made.success()), "mkfifo is there");
        let refused = RemoteToken::from_file(&path).expect_err("it is no regular file");
        fs::remove_file(&path).expect("it is there");
        assert!(refused.to_string().contains("no regular file"), "{refused}");
    }
}

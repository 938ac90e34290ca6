//! Errors with their exit code.

use airlight::NoDevice;
use airlight::exec::{ExecError, RenderError};
use airlight_formats::FormatError;
use airlight_formats::scene::SceneFileError;

/// Why the program ends, and with which code.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) code: u8,
    pub(crate) message: String,
}

impl Failure {
    /// It failed while running.
    pub(crate) fn running(message: impl ToString) -> Self {
        Self { code: 1, message: message.to_string() }
    }

    /// Bad usage or bad input.
    pub(crate) fn input(message: impl ToString) -> Self {
        Self { code: 2, message: message.to_string() }
    }

    /// A comparison fell short.
    pub(crate) fn short(message: impl ToString) -> Self {
        Self { code: 3, message: message.to_string() }
    }

    /// The same, with what was being worked on.
    pub(crate) fn within(self, what: &str) -> Self {
        Self { message: format!("{what}: {}", self.message), ..self }
    }

    /// An output that could not be written.
    pub(crate) fn output(error: FormatError) -> Self {
        Self::running(error)
    }
}

impl From<FormatError> for Failure {
    fn from(error: FormatError) -> Self {
        Self::input(error)
    }
}

impl From<SceneFileError> for Failure {
    fn from(error: SceneFileError) -> Self {
        Self::input(error.report())
    }
}

impl From<NoDevice> for Failure {
    fn from(error: NoDevice) -> Self {
        Self::input(error)
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            // The scene asks for more than the machine has: it is the input that must change.
            RenderError::Scene(_) | RenderError::Transfer(_) | RenderError::Exec(ExecError::Memory { .. }) => {
                Self::input(error)
            }
            RenderError::Exec(_) => Self::running(error),
        }
    }
}

//! The application behind a controller's PDI.

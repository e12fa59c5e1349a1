//! Error reports with the line of the real file, also when it was included.

use super::Source;
use naga::{Span, WithSpan, front::wgsl::ParseError, valid::ValidationError};
use std::error::Error;

/// A report of a parse error.
pub fn parse(source: &Source, error: &ParseError) -> String {
    let mut report = format!("error: {}", error.message());
    for (span, label) in error.labels() {
        report += &excerpt(source, span, label);
    }
    for note in error.notes() {
        report += &format!("\n = note: {note}");
    }
    report
}

/// A report of a validation error with all its causes.
pub fn validation(source: &Source, error: &WithSpan<ValidationError>) -> String {
    let mut report = format!("error: {}: {}", source.name(), error.as_inner());
    let mut cause = error.as_inner().source();
    while let Some(inner) = cause {
        report += &format!("\n = {inner}");
        cause = inner.source();
    }
    for (span, label) in error.spans() {
        report += &excerpt(source, *span, label);
    }
    report
}

/// A report of our own.
pub fn at(source: &Source, span: Span, problem: &str) -> String {
    format!("error: {problem}{}", excerpt(source, span, ""))
}

/// The line of the span with a mark under it.
fn excerpt(source: &Source, span: Span, label: &str) -> String {
    if !span.is_defined() {
        return format!("\n  --> {}: {label}", source.name());
    }
    let place = span.location(&source.text);
    let (line, column) = (place.line_number as usize, place.line_position as usize);
    let Some((file, number)) = source.origin(line) else {
        return format!("\n  --> {}: {label}", source.name());
    };
    let text = source.text.lines().nth(line - 1).unwrap_or_default();
    // Spans of several lines are marked on their first.
    let width = (place.length as usize).clamp(1, (text.len() + 1).saturating_sub(column).max(1));
    let gutter = number.to_string().len();
    format!(
        "\n  --> {}:{number}:{column}\n {:gutter$} |\n {number} | {text}\n {:gutter$} | {}{} {label}",
        file.display(),
        "",
        "",
        " ".repeat(column - 1),
        "^".repeat(width)
    )
}

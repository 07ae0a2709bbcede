//! Findings as JUnit XML, the format that build servers read.
//!
//! The dialect is that of Ant's task, as most readers take it: one `testsuite` with a `testcase` for each
//! clause.

use std::fmt::Write;

use super::finding::{Finding, Verdict};

/// The findings as one XML document; `suite` names the rig.
#[must_use]
pub fn junit(suite: &str, findings: &[Finding]) -> String {
    let count = |wanted: Verdict| findings.iter().filter(|finding| finding.verdict == wanted).count();
    // A measurement that settles several clauses is counted once with each.
    let elapsed: f64 = findings.iter().map(|finding| finding.elapsed_s).sum();
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing into a string cannot fail.
    let _ = writeln!(
        text,
        "<testsuites><testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" skipped=\"{}\" time=\"{elapsed:.3}\">",
        escaped(suite),
        findings.len(),
        count(Verdict::Broken),
        count(Verdict::NotTried),
    );
    for finding in findings {
        let facts = finding.clause.facts();
        let _ = write!(
            text,
            "<testcase classname=\"conformance.{}\" name=\"{}\" time=\"{:.3}\">",
            facts.level, facts.id, finding.elapsed_s
        );
        let measured = escaped(&finding.measured);
        let _ = match finding.verdict {
            Verdict::Kept => write!(text, "<system-out>{measured}</system-out>"),
            Verdict::NotTried => write!(text, "<skipped message=\"{measured}\"/>"),
            Verdict::Broken => write!(
                text,
                "<failure message=\"{measured}\">{}\nright: {}</failure>",
                escaped(facts.claim),
                escaped(facts.right)
            ),
        };
        text.push_str("</testcase>\n");
    }
    text.push_str("</testsuite></testsuites>\n");
    text
}

/// Text as it may stand in an attribute; characters that XML has no way to write become question marks.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\n' => escaped.push_str("&#10;"),
            letter if letter.is_control() => escaped.push('?'),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::super::clause::Clause;
    use super::{Finding, Verdict, escaped, junit};

    #[test]
    fn every_clause_is_a_case_and_text_is_escaped() {
        let finding = |clause, verdict, measured: &str| Finding {
            clause,
            verdict,
            measured: measured.to_owned(),
            elapsed_s: 0.25,
        };
        let text = junit(
            "a<b>",
            &[
                finding(Clause::FeedbackRate, Verdict::Kept, "1000 Hz"),
                finding(Clause::CurrentSign, Verdict::Broken, "coil 0 \"-2 A\" & so on"),
                finding(Clause::AngleSign, Verdict::NotTried, "none"),
            ],
        );
        assert!(text.contains(
            "<testsuite name=\"a&lt;b&gt;\" tests=\"3\" failures=\"1\" errors=\"0\" skipped=\"1\""
        ));
        assert!(
            text.contains(
                "name=\"feedback-rate\" time=\"0.250\"><system-out>1000 Hz</system-out></testcase>"
            )
        );
        assert!(text.contains("<failure message=\"coil 0 &quot;-2 A&quot; &amp; so on\">"));
        assert!(text.contains("classname=\"conformance.dummy-load\" name=\"angle-sign\""));
        assert_eq!(text.matches("</testcase>").count(), 3);
    }

    #[test]
    fn characters_that_xml_cannot_write_are_replaced() {
        assert_eq!(escaped("a\u{0}\u{1b}b\nc"), "a??b&#10;c");
    }
}

//! The kernel's files, read below a root, so that tests can bring a machine of their own.

use std::path::{Path, PathBuf};

/// Where the kernel tells of itself.
#[derive(Debug, Clone)]
pub struct Machine {
    root: PathBuf,
}

impl Machine {
    /// The machine that this program runs on.
    pub fn this() -> Self {
        Self { root: PathBuf::from("/") }
    }

    /// A machine whose files lie below `root`.
    #[cfg(test)]
    pub fn below(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// A file's text without blanks at its ends; `None` when it is missing or must not be read.
    pub fn text(&self, path: &str) -> Option<String> {
        std::fs::read_to_string(self.path(path)).ok().map(|text| text.trim().to_owned())
    }

    /// A file that holds one number.
    pub fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// Names in a directory that begin with `prefix`, in order.
    pub fn names(&self, directory: &str, prefix: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.path(directory)) else { return Vec::new() };
        let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
        let mut found: Vec<String> = names.filter(|name| name.starts_with(prefix)).collect();
        found.sort();
        found
    }

    /// The CPUs that a file lists, as `0-3,7`; empty when it is missing.
    pub fn cpus(&self, path: &str) -> Vec<u32> {
        self.text(path).map(|text| cpu_list(&text)).unwrap_or_default()
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.join(Path::new(path).strip_prefix("/").unwrap_or(Path::new(path)))
    }
}

/// The kernel's lists of CPUs; what is no number is left out.
fn cpu_list(text: &str) -> Vec<u32> {
    /// More than any kernel has.
    const CPUS_MAX: u32 = 8192;
    let mut cpus = Vec::new();
    for part in text.split(',').map(str::trim) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        if let (Ok(first), Ok(last)) = (first.parse::<u32>(), last.parse::<u32>()) {
            cpus.extend(first..=last.min(CPUS_MAX));
        }
    }
    cpus
}

#[cfg(test)]
mod tests {
    use super::cpu_list;

    #[test]
    fn lists_of_cpus_are_read_as_the_kernel_writes_them() {
        assert_eq!(cpu_list("0"), [0]);
        assert_eq!(cpu_list("0-3,7, 10-11"), [0, 1, 2, 3, 7, 10, 11]);
        for nothing in ["", "(null)", "3-1", "x-y"] {
            assert!(cpu_list(nothing).is_empty(), "{nothing}");
        }
    }
}

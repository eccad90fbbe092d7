//! Every reader reads damaged files: each must be read, or refused with one line that names it, in limited memory and time.
//! README.md beside this folder says how to do so for an hour.

mod corpus;
mod damage;
mod formats;
mod readers;
mod seeds;

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use damage::Random;
use readers::{Bench, REASONS, Reader, Taken};

/// Seconds to go on for, with other damage each round; without it, one round as below.
const SECONDS: &str = "PBR_VR_FUZZ_SECONDS";
/// The number that decides all damage of the first round.
const SEED: &str = "PBR_VR_FUZZ_SEED";
/// The only reader, by its name.
const READER: &str = "PBR_VR_FUZZ_READER";
/// The only case, by its number.
const CASE: &str = "PBR_VR_FUZZ_CASE";
/// The most address space of a child, in KiB, or `unlimited`.
#[cfg(unix)]
const MEMORY: &str = "PBR_VR_FUZZ_KIB";
/// What a child process is to do.
const JOB: &str = "PBR_VR_FUZZ_JOB";

/// One file takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(120);
/// It if not told: somewhat more than the most that a reader may ask for, which is 4 GiB.
#[cfg(unix)]
const MEMORY_KIB: u64 = 8 << 20;
/// Places where each seed is cut off; by hand, every one of its bytes in some rounds.
const CUTS: u64 = 48;
const ROUNDS: u64 = 16;
/// The largest file of the large scenes that is damaged, and once in how many cases one is.
const LARGEST: u64 = 500_000;
const LARGE_ONCE_IN: usize = 16;
/// Words of a child's progress.
const WORDS: usize = 8;

/// What a child process has done so far, in a file that outlives it.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// Cases that were begun, and those behind the last one.
    case: u64,
    end: u64,
    read: u64,
    gave_up: u64,
    slowest_us: u64,
    slowest: u64,
    /// The most memory that the child has used, and the case that first did.
    peak_kib: u64,
    largest: u64,
}

impl Progress {
    fn write(&self, file: &mut File) {
        let Self { case, end, read, gave_up, slowest_us, slowest, peak_kib, largest } = *self;
        let words: [u64; WORDS] = [case, end, read, gave_up, slowest_us, slowest, peak_kib, largest];
        file.rewind().unwrap();
        file.write_all(bytemuck::cast_slice(&words)).unwrap();
    }

    fn of(path: &Path) -> Self {
        let mut words = [0; WORDS];
        let read = File::open(path).and_then(|mut file| file.read_exact(bytemuck::cast_slice_mut(&mut words)));
        let [case, end, whole, gave_up, slowest_us, slowest, peak_kib, largest] = words;
        read.map_or(Self::default(), |()| Self {
            case,
            end,
            read: whole,
            gave_up,
            slowest_us,
            slowest,
            peak_kib,
            largest,
        })
    }
}

/// The damaged files of one reader and one seed, by number: first those that are cut off, then all others.
struct Cases {
    reader: Reader,
    seed: u64,
    by_hand: bool,
    whole: Vec<Vec<u8>>,
    large: Vec<Vec<u8>>,
}

impl Cases {
    fn new(reader: Reader, seed: u64, by_hand: bool, bench: &Bench) -> Self {
        let large = if by_hand { large_scenes(reader) } else { Vec::new() };
        Self { reader, seed, by_hand, whole: reader.seeds(bench), large }
    }

    fn cuts(&self, whole: &[u8]) -> u64 {
        let all = self.by_hand && self.seed % ROUNDS == 1;
        if all { whole.len() as u64 } else { CUTS.min(whole.len() as u64) }
    }

    fn count(&self) -> u64 {
        let cuts: u64 = self.whole.iter().map(|whole| self.cuts(whole)).sum();
        cuts + self.reader.cases()
    }

    fn file(&self, case: u64) -> Vec<u8> {
        let mut left = case;
        for whole in &self.whole {
            let cuts = self.cuts(whole);
            if left < cuts {
                // Other places with other seeds, where not every one is tried.
                let step = whole.len() as u64 / cuts;
                return whole[..(left * step + self.seed % step) as usize].to_vec();
            }
            left -= cuts;
        }
        let mut random = Random::of([self.reader as u64, self.seed, case]);
        let is_large = !self.large.is_empty() && random.once_in(LARGE_ONCE_IN);
        let seeds = if is_large { &self.large } else { &self.whole };
        let [seed, other] = [0, 1].map(|_| random.below(seeds.len()));
        if is_large && random.once_in(4) {
            return seeds[seed][..random.below(seeds[seed].len())].to_vec();
        }
        self.reader.format().damaged(&mut random, &seeds[seed], &seeds[other])
    }
}

/// Files of the large scenes that are not too large, the smallest first.
fn large_scenes(reader: Reader) -> Vec<Vec<u8>> {
    let Some(folder) = std::env::var_os("PBR_VR_SCENES").map(PathBuf::from) else { return Vec::new() };
    let (mut folders, mut files) = (vec![folder], Vec::new());
    while let Some(entry) = folders.pop() {
        for path in fs::read_dir(entry).into_iter().flatten().flatten().map(|entry| entry.path()) {
            let fits = path.extension().is_some_and(|own| reader.extensions().iter().any(|known| own == *known));
            match path.metadata() {
                Ok(data) if data.is_dir() => folders.push(path),
                Ok(data) if fits && data.len() <= LARGEST => files.push((data.len(), path)),
                _ => {}
            }
        }
    }
    files.sort();
    files.into_iter().take(6).map(|(_, path)| fs::read(path).unwrap()).collect()
}

/// What a child is told, and tells its parent of: `reader seed by_hand first end folder`.
#[test]
fn child() {
    let Ok(job) = std::env::var(JOB) else { return };
    let [reader, seed, by_hand, first, end, folder] = job.splitn(6, ' ').collect::<Vec<_>>()[..] else {
        panic!("{job}")
    };
    let reader = Reader::ALL.into_iter().find(|known| known.name() == reader).expect("a reader");
    let folder = Path::new(folder);
    let bench = Bench::new(reader, folder);
    let cases = Cases::new(reader, seed.parse().unwrap(), by_hand == "true", &bench);
    let mut file = File::create(folder.join("progress")).unwrap();
    let end = cases.count().min(end.parse().unwrap());
    let mut progress = Progress { case: first.parse().unwrap(), end, ..Progress::default() };
    while progress.case < progress.end {
        progress.write(&mut file);
        let bytes = cases.file(progress.case);
        let started = Instant::now();
        match bench.read(&bytes) {
            Taken::Read => progress.read += 1,
            Taken::GaveUp => progress.gave_up += 1,
            Taken::Refused => {}
        }
        let took = started.elapsed().as_micros() as u64;
        if took > progress.slowest_us {
            (progress.slowest_us, progress.slowest) = (took, progress.case);
        }
        let peak = peak_kib();
        if peak > progress.peak_kib {
            (progress.peak_kib, progress.largest) = (peak, progress.case);
        }
        progress.case += 1;
    }
    progress.write(&mut file);
}

/// The most memory that this process has used; 0 where Linux does not tell.
fn peak_kib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}

/// The same test binary as a child, which may use so much memory and leaves no core file.
#[cfg(unix)]
fn start(job: &str, errors: File) -> Child {
    let program = std::env::current_exe().unwrap();
    let kib = std::env::var(MEMORY).unwrap_or(MEMORY_KIB.to_string());
    let script = format!("ulimit -c 0; ulimit -v {kib} && exec \"$0\" \"$@\"");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).arg(program).args(["--exact", "fuzz_tests::child", "--nocapture"]);
    shell.env(JOB, job).env("RAYON_NUM_THREADS", "2").stdout(Stdio::null()).stderr(errors).spawn().unwrap()
}

#[cfg(not(unix))]
fn start(job: &str, errors: File) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", "fuzz_tests::child", "--nocapture"]);
    child.env(JOB, job).stdout(Stdio::null()).stderr(errors).spawn().unwrap()
}

/// Waits for a child; why it did not end well.
fn failure(child: &mut Child, progress: &Path) -> Option<String> {
    let (mut since, mut case) = (Instant::now(), u64::MAX);
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return (!status.success()).then(|| format!("ended with {status}"));
        }
        let now = Progress::of(progress).case;
        if now != case {
            (since, case) = (Instant::now(), now);
        }
        if since.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            return Some(format!("took over {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What came of one reader.
#[derive(Debug, Default)]
struct Tally {
    cases: u64,
    read: u64,
    gave_up: u64,
    slowest_ms: f64,
    slowest: String,
    peak_mib: u64,
    largest: String,
    reasons: BTreeSet<String>,
    failures: Vec<String>,
}

/// Reads all cases of a seed, those behind a failure in a process of their own.
fn read_all(reader: Reader, seed: u64, by_hand: bool, tally: &mut Tally) {
    let folder = tempfile::tempdir().unwrap();
    let (progress, errors) = (folder.path().join("progress"), folder.path().join("errors"));
    let only = number(CASE);
    let (mut first, mut end) = only.map_or((0, u64::MAX), |only| (only, only + 1));
    while first < end {
        let job = format!("{} {seed} {by_hand} {first} {end} {}", reader.name(), folder.path().display());
        let mut child = start(&job, File::create(&errors).unwrap());
        let failed = failure(&mut child, &progress);
        let done = Progress::of(&progress);
        assert!(done.end > 0, "{job}: nothing was read: {failed:?}: {}", fs::read_to_string(&errors).unwrap());
        end = done.end;
        tally.cases += done.case - first;
        tally.read += done.read;
        tally.gave_up += done.gave_up;
        if done.slowest_us as f64 > 1e3 * tally.slowest_ms {
            (tally.slowest_ms, tally.slowest) = (done.slowest_us as f64 / 1e3, format!("{seed} {}", done.slowest));
        }
        if done.peak_kib >> 10 > tally.peak_mib {
            (tally.peak_mib, tally.largest) = (done.peak_kib >> 10, format!("{seed} {}", done.largest));
        }
        first = done.case;
        if let Some(how) = failed {
            let file = kept(reader, seed, done.case, folder.path());
            let said = fs::read(&errors).unwrap();
            let said: Vec<_> = String::from_utf8_lossy(&said).lines().take(12).map(str::to_owned).collect();
            tally.failures.push(format!("{}: {how}\n    {}", file.display(), said.join("\n    ")));
            tally.cases += 1;
            first += 1;
        }
        let reasons = fs::read_to_string(folder.path().join(REASONS)).unwrap_or_default();
        tally.reasons.extend(reasons.lines().map(|line| line.to_owned()));
        if let Some(only) = only {
            println!("{}", kept(reader, seed, only, folder.path()).display());
        }
        // Another one begins with none.
        fs::remove_file(&progress).unwrap();
    }
}

/// Copies the file of a failed case to `target/fuzz`.
fn kept(reader: Reader, seed: u64, case: u64, folder: &Path) -> PathBuf {
    let target = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().join("fuzz");
    fs::create_dir_all(&target).unwrap();
    let file = target.join(format!("{}-{seed}-{case}-{}", reader.name(), reader.file()));
    fs::copy(folder.join(reader.file()), &file).unwrap();
    file
}

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|text| text.parse().expect("a number"))
}

/// In an ordinary run the same damage every time; by hand, other damage until the time is over.
#[test]
fn damaged_files_are_read_or_refused() {
    if cfg!(not(unix)) {
        println!("Here memory is not limited: there is no ulimit.");
    }
    let only = std::env::var(READER).ok();
    let readers: Vec<Reader> =
        Reader::ALL.into_iter().filter(|reader| only.as_ref().is_none_or(|only| *only == reader.name())).collect();
    assert!(!readers.is_empty(), "{only:?} is none of {:?}", Reader::ALL.map(Reader::name));
    let seconds = number(SECONDS);
    let mut tallies: Vec<Tally> = readers.iter().map(|_| Tally::default()).collect();
    let started = Instant::now();
    for seed in number(SEED).unwrap_or(1).. {
        for (reader, tally) in readers.iter().zip(&mut tallies) {
            let before = Instant::now();
            read_all(*reader, seed, seconds.is_some(), tally);
            println!("{} {seed}: {:.1} s", reader.name(), before.elapsed().as_secs_f64());
        }
        let is_over = seconds.is_none_or(|seconds| started.elapsed().as_secs() >= seconds);
        if is_over || number(CASE).is_some() {
            break;
        }
    }
    println!(
        "| reader | cases | read | refused | decoder gave up | failed | slowest, ms (seed and case) | most memory, MiB (the same) |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (reader, tally) in readers.iter().zip(&tallies) {
        let Tally { cases, read, gave_up, slowest_ms, slowest, peak_mib, largest, failures, reasons } = tally;
        let refused = cases - read - gave_up - failures.len() as u64;
        let (name, failed) = (reader.name(), failures.len());
        print!("| {name} | {cases} | {read} | {refused} | {gave_up} | {failed} | {slowest_ms:.0} ({slowest}) ");
        println!("| {peak_mib} ({largest}) |");
        reasons.iter().for_each(|reason| println!("    {reason}"));
    }
    let failures: Vec<String> = tallies.into_iter().flat_map(|tally| tally.failures).collect();
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

/// What failed once, and was mended.
#[test]
fn what_failed_once_is_read_or_refused() {
    for (number, (reader, showed, bytes)) in corpus::all().into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let taken = Bench::new(reader, folder.path()).read(&bytes);
        println!("{number}: {}: {showed}: {taken:?}", reader.name());
    }
}

//! Where along the rod the centreline is evaluated, and its values there.

use nalgebra::Vector3;

use super::outline::Piece;

/// Stations along the whole rod, about; half a millimetre for a rod of 60 mm. Between two stations the
/// centreline leaves its tangent by `curvature x (spacing / 2)^2 / 2`: under 2 um at 50 1/m.
const STATIONS: f64 = 120.0;

/// One arc length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Station {
    /// m
    pub s: f64,
    /// Of the surface around it, m.
    pub radius: f64,
    /// False next to a change of radius, where noise puts points to the wrong side of it.
    pub is_usable: bool,
}

/// The stretch between a station and the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    /// m
    pub length: f64,
    /// Index of the piece that it is part of.
    pub piece: usize,
}

/// Constants of a rod.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub stations: Vec<Station>,
    /// One fewer than stations.
    pub spans: Vec<Span>,
    /// The station at each magnet's centre.
    pub magnets: Vec<usize>,
    /// The station at each magnet's far end.
    pub magnet_ends: Vec<usize>,
    pub pieces: Vec<Piece>,
}

impl Layout {
    /// Stations at every joint of two pieces, at the magnets' centres, and evenly in between. Points within
    /// `noise` of a change of radius are not to be used.
    pub fn new(pieces: Vec<Piece>, noise: f64) -> Self {
        let length = pieces.last().map_or(0.0, Piece::end);
        let first =
            Station { s: 0.0, radius: pieces.first().map_or(0.0, |piece| piece.radius), is_usable: true };
        let mut layout = Self {
            stations: vec![first],
            spans: Vec::new(),
            magnets: Vec::new(),
            magnet_ends: Vec::new(),
            pieces,
        };
        for index in 0..layout.pieces.len() {
            layout.add(index, length / STATIONS);
        }
        let shoulders: Vec<f64> = layout
            .pieces
            .windows(2)
            .filter(|pair| (pair[0].radius - pair[1].radius).abs() > 0.1 * noise)
            .map(|pair| pair[1].start)
            .collect();
        for station in &mut layout.stations {
            station.is_usable = shoulders.iter().all(|shoulder| (station.s - shoulder).abs() > noise);
        }
        layout
    }

    fn add(&mut self, index: usize, spacing: f64) {
        let piece = self.pieces[index];
        // An even number has a station in the middle.
        let half = (piece.length / (2.0 * spacing)).ceil().max(1.0) as usize;
        let length = piece.length / (2 * half) as f64;
        for step in 1..=2 * half {
            let s = piece.start + length * step as f64;
            self.stations.push(Station { s, radius: piece.radius, is_usable: true });
            self.spans.push(Span { length, piece: index });
        }
        if !piece.is_flexible {
            self.magnets.push(self.stations.len() - 1 - half);
            self.magnet_ends.push(self.stations.len() - 1);
        }
    }

    /// m
    pub fn length(&self) -> f64 {
        self.pieces.last().map_or(0.0, Piece::end)
    }
}

/// The centreline at the stations, and how it depends on the first `active` parameters.
#[derive(Debug, Clone)]
pub(super) struct Centreline {
    parameters: usize,
    /// `P`, m, world.
    pub position: Vec<Vector3<f64>>,
    /// `P' / |P'|`
    pub tangent: Vec<Vector3<f64>>,
    /// Parameters on which each station depends: these and no later ones.
    pub active: Vec<usize>,
    shifts: Vec<Vector3<f64>>,
    turns: Vec<Vector3<f64>>,
}

impl Centreline {
    pub fn new(stations: usize, parameters: usize) -> Self {
        Self {
            parameters,
            position: vec![Vector3::zeros(); stations],
            tangent: vec![Vector3::z(); stations],
            active: vec![0; stations],
            shifts: vec![Vector3::zeros(); stations * parameters],
            turns: vec![Vector3::zeros(); stations * parameters],
        }
    }

    /// Derivatives of a station's position by its active parameters.
    pub fn shifts(&self, station: usize) -> &[Vector3<f64>] {
        let first = station * self.parameters;
        &self.shifts[first..first + self.active[station]]
    }

    /// Derivatives of a station's tangent by its active parameters.
    pub fn turns(&self, station: usize) -> &[Vector3<f64>] {
        let first = station * self.parameters;
        &self.turns[first..first + self.active[station]]
    }

    /// Both of one station, to fill.
    pub fn derivatives_mut(&mut self, station: usize) -> (&mut [Vector3<f64>], &mut [Vector3<f64>]) {
        let range = station * self.parameters..station * self.parameters + self.active[station];
        (&mut self.shifts[range.clone()], &mut self.turns[range])
    }
}

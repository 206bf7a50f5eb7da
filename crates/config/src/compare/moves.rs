//! Which SubDevices of a sequence are at another place: pairs that have changed places, and single ones that moved.
//! Missing and additional SubDevices are no part of the sequence: they move nothing behind them.

/// A change of place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Move {
    /// It is at another place.
    Alone,
    /// It has changed places with this one.
    With(usize),
}

/// The changes of a sequence in the order of the file; `bus` are the places of its members on the bus, each once.
pub(super) fn moves(bus: &[usize]) -> Vec<Option<Move>> {
    let mut order: Vec<usize> = (0..bus.len()).collect();
    order.sort_by_key(|at| bus[*at]);
    let mut ranks = vec![0; bus.len()];
    for (rank, at) in order.into_iter().enumerate() {
        ranks[at] = rank;
    }
    let swapped = |at: usize| ranks[at] != at && ranks[ranks[at]] == at;
    let mut moves: Vec<Option<Move>> = (0..bus.len()).map(|at| swapped(at).then(|| Move::With(ranks[at]))).collect();
    let rest: Vec<usize> = (0..bus.len()).filter(|at| moves[*at].is_none()).collect();
    let mut stays = vec![false; bus.len()];
    for at in in_order(&rest, &ranks) {
        stays[at] = true;
    }
    for at in rest {
        // One that is not in order may still be at its place, between others that moved.
        if !stays[at] && ranks[at] != at {
            moves[at] = Some(Move::Alone);
        }
    }
    moves
}

/// The longest subsequence in order; of several, the one with the most members at their places.
fn in_order(members: &[usize], ranks: &[usize]) -> Vec<usize> {
    // A Fenwick tree over the ranks, with the best subsequence up to each rank: its length, its members at their
    // places, its last member.
    let mut tree: Vec<(u32, u32, usize)> = vec![(0, 0, usize::MAX); ranks.len() + 1];
    let mut before = vec![usize::MAX; ranks.len()];
    let mut best = (0, 0, usize::MAX);
    for &at in members {
        let (mut length, mut placed) = (0, 0);
        let mut node = ranks[at];
        while node > 0 {
            let (other, also, last) = tree[node];
            if (other, also) > (length, placed) {
                (length, placed, before[at]) = (other, also, last);
            }
            node &= node - 1;
        }
        let end = (length + 1, placed + u32::from(ranks[at] == at), at);
        let mut node = ranks[at] + 1;
        while node <= ranks.len() {
            if (end.0, end.1) > (tree[node].0, tree[node].1) {
                tree[node] = end;
            }
            node += node & node.wrapping_neg();
        }
        if (end.0, end.1) > (best.0, best.1) {
            best = end;
        }
    }
    let mut members = Vec::new();
    let mut at = best.2;
    while let Some(previous) = before.get(at) {
        members.push(at);
        at = *previous;
    }
    members
}

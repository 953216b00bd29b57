#pragma once

#include <algorithm>
#include <cmath>
#include <pendula/chain.hpp>
#include <pendula/chart.hpp>
#include <pendula/gauss/chain_links.hpp>
#include <pendula/gauss/chain_motion.hpp>
#include <pendula/gauss/energy_tally.hpp>
#include <pendula/gauss/lanes.hpp>
#include <pendula/gauss/sincos.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/state.hpp>
#include <xsimd/xsimd.hpp>

namespace pendula {

namespace detail {

/// The coefficients of a step, one column a stage, padded to lanes.
template <int S, class Real>
class StageColumns {
  using L = Lanes<S, Real>;
  static constexpr std::size_t stages = S, Z = L::size;

 public:
  StageColumns() : coefficients_(gauss_tableau<S, Real>(S)) {
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) m_[j][i] = coefficients_.m(i, j);
    }
  }

  void prepare(Real h, Real previous) {
    coefficients_.prepare(h, previous);
    const Real ratio = previous == 0 ? Real(1) : Real(h / previous);
    if (h == h_ && ratio == ratio_) return;
    h_ = h;
    ratio_ = ratio;
    for (int j = 0; j < S; ++j) {
      hb_[j] = coefficients_.hb(j);
      for (int i = 0; i < S; ++i) extrapolation_[j][i] = coefficients_.extrapolation(i, j);
    }
  }

  Real h() const { return h_; }
  Real hc(std::size_t i) const { return coefficients_.hc(static_cast<int>(i)); }
  Real hb(std::size_t j) const { return hb_[j]; }
  Real ha(std::size_t i, std::size_t j) const { return coefficients_.ha(static_cast<int>(i), static_cast<int>(j)); }

  /// h Σ_j a_ij x_j for all i, as m_ij (h b_j x_j).
  L integral(const L& x) const {
    alignas(pack_alignment) Real weighted[Z];
    (L::load(hb_) * x).store(weighted);
    return product(m_, weighted);
  }

  /// The polynomial through last step's stage values, at this step's stages.
  L extrapolated(const Real* last) const { return product(extrapolation_, last); }

 private:
  static L product(const Real (&columns)[stages][Z], const Real* x) {
    L even = L(x[0]) * L::load(columns[0]);
    if constexpr (S == 1) return even;
    L odd = L(x[S > 1]) * L::load(columns[S > 1]);
    for (std::size_t j = 2; j < S; j += 2) {
      even = fma(L(x[j]), L::load(columns[j]), even);
      if (j + 1 < S) odd = fma(L(x[j + 1]), L::load(columns[j + 1]), odd);
    }
    return even + odd;
  }

  StepCoefficients<S, Real> coefficients_;
  Real h_{0}, ratio_{0};
  alignas(pack_alignment) Real m_[stages][Z] = {};
  alignas(pack_alignment) Real extrapolation_[stages][Z] = {};
  alignas(pack_alignment) Real hb_[Z] = {};
};

/// Adds an increment to a number carried as value + low part (Kahan–Neumaier).
template <class Real>
void add_compensated(const Real& increment, Real& value, Real& low) {
  const Real wanted = low + increment;
  const Real sum = value + wanted;
  const Real kept = sum - value;
  low = (value - (sum - kept)) + (wanted - kept);
  value = sum;
}

}  // namespace detail

/// What both iterations on the stages of a chain share: state, charts, stage values, predictor, update.
///
/// In momentum form, q̇ = v, ṗ = f: stage i has position Q_i = q + h Σ_j a_ij V_j and momentum P_i = p + h Σ_j a_ij f_j.
/// Arrays hold [link][coordinate][stage]; the stages of one number are a Lanes<S, Real>, so that everything is done for
/// all stages at once. q and p are kept in each link's chart, as value + low part.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainStages {
 public:
  using Link = typename Space::Link;
  using L = Lanes<S, Real>;
  using Coordinates = typename Link::template Coordinates<L>;
  using Cartesian = typename Link::template Cartesian<L>;
  using Trig = typename Link::template Trig<L>;
  static constexpr std::size_t K = Space::dof, D = Space::dimension, Z = L::size;

  explicit ChainStages(const Chain<Space, N>& chain)
      : chain_(chain),
        constants_(chain),
        charts_(chain.links(), 0),
        user_(chain.links()),
        q_(chain.links()),
        q_low_(chain.links()),
        p_(chain.links()),
        p_low_(chain.links()),
        V_(chain.links()),
        F_(chain.links()),
        sine_(chain.links()),
        cosine_(chain.links()),
        w_(chain.links()),
        torque_(chain.loaded() ? chain.links() : 0),
        at_state_(chain.links()),
        saved_{charts_, user_, detail::LinkArray<4 * K, N, Real>(chain.links())},
        tried_(chain.links()) {
    if (constants_.loaded()) {
      for (int i = 0; i < links(); ++i) set_constant_torque(i);
    }
  }

  int links() const { return constants_.links(); }
  const LinkConstants<Real>& constants(int i) const { return constants_[i]; }
  const detail::StageColumns<S, Real>& columns() const { return columns_; }
  bool loaded() const { return constants_.loaded(); }
  Chart chart(int i) const { return charts_[i]; }
  std::int64_t chart_switches() const { return chart_switches_; }
  Real h() const { return columns_.h(); }

  // --- Values of one link at all stages ---

  Coordinates rates(int i) const { return load_each<K>(V_[i]); }
  Coordinates forces(int i) const { return load_each<K>(F_[i]); }
  Cartesian bob_velocity(int i) const { return load_each<D>(w_[i]); }
  void set_rates(int i, const Coordinates& v) { store_each(v, V_[i]); }
  void set_forces(int i, const Coordinates& f) { store_each(f, F_[i]); }
  Real* stored_rates(int i) { return V_[i]; }

  Trig trig(int i) const {
    Trig trig;
    Link::trig_from(load_each<K>(sine_[i]), load_each<K>(cosine_[i]), trig);
    return trig;
  }

  Placed<Space, L> placed(int i) const { return {charts_[i], trig(i)}; }

  /// P_i = p + h Σ_j a_ij f_j.
  Momenta<Coordinates> stage_momenta(int i) const {
    Momenta<Coordinates> P;
    for (std::size_t a = 0; a < K; ++a) {
      const L p(p_[i][a]), pushed = columns_.integral(L::load(F_[i] + a * Z)) + L(p_low_[i][a]);
      P.value[a] = p + pushed;
      P.low[a] = (p - P.value[a]) + pushed;
    }
    return P;
  }

  /// u_a·G − P_i, the increment summed before p is met.
  L momentum_residual(int i, std::size_t a, const L& momentum, const L& force) const {
    return (momentum - L(p_[i][a])) - (columns_.integral(force) + L(p_low_[i][a]));
  }

  /// Load R on link i in the axes of its chart: weight, torque, drag.
  Cartesian load(int i, Chart chart, const Trig& trig, const Coordinates& v) const {
    Cartesian load = to_chart(chart, constants_.template weight<L>(i));
    if (loaded()) constants_.add_loads(i, torque(i), trig, v, load);
    return load;
  }

  /// Torque on link i in the axes of its chart.
  auto torque(int i) const { return to_chart(charts_[i], load_each<Space::torque_components>(torque_[i])); }

  /// Keeps the stage velocities, in the room of the bobs'; afterwards tells which link's have changed most.
  void keep_rates() {
    for (int i = 0; i < links(); ++i) std::copy_n(V_[i], K * Z, w_[i]);
  }
  int most_changed_link() const {
    int link = -1;
    double most = 0;
    for (int i = 0; i < links(); ++i) {
      for (std::size_t k = 0; k < K * Z; ++k) {
        const double change = std::abs(static_cast<double>(V_[i][k] - w_[i][k]));
        if (k % Z >= S) continue;
        if (!std::isfinite(change)) return i;
        if (change <= most) continue;
        most = change;
        link = i;
      }
    }
    return link;
  }

  // --- A step ---

  /// Takes over a state. A link near the pole starts in its other chart.
  void start(const State<Space, N, Real>& state) {
    chart_switches_ = 0;
    forget();
    for (int i = 0; i < links(); ++i) start_link(i, state);
    set_momenta();
    run_start_ = tally_at_state();
  }

  /// Predicts the stages of a step of size h: from the last step's, or cold where there was none like it.
  void prepare(double time, double h) {
    const bool alike = last_h_ != 0 && std::abs(h / last_h_) < farthest_extrapolation;
    columns_.prepare(Real(h), Real(alike ? last_h_ : 0));
    step_ = h;
    if (chain_.driven()) set_driven_torques(time);
    if (!alike) return start_cold();
    for (int i = 0; i < links(); ++i) {
      for (std::size_t a = 0; a < K; ++a) {
        columns_.extrapolated(V_[i] + a * Z).store(V_[i] + a * Z);
        columns_.extrapolated(F_[i] + a * Z).store(F_[i] + a * Z);
      }
    }
    last_h_ = 0;  // what was predicted from is gone until the step is accepted
  }

  /// Stage velocities and forces of a motion that is what it is at the start of the step.
  void start_cold() {
    sweep_state(at_state_, [&](int i, const Rates& v, const Rates& f) {
      for (std::size_t a = 0; a < K; ++a) {
        L(v[a]).store(V_[i] + a * Z);
        L(f[a]).store(F_[i] + a * Z);
      }
    });
    last_h_ = 0;
  }

  /// Places the stages by V and takes their sines and cosines.
  void place() {
    for (int end = links(); end > 0; end = block_before(end)) place_block(end);
  }

  /// Links are placed from the last one to the first, a few at once: [block_before(end), end).
  static int block_before(int end) { return (end - 1) / placed_at_once * placed_at_once; }

  void place_block(int end) {
    const int begin = block_before(end);
    if (links() <= placed_one_by_one) {
      place_one_by_one(begin, end);
    } else {
      place_together(begin, end);
    }
  }

  /// Velocities of the bobs at the placed stages, w_i = w_{i−1} + l Σ_a V_a û_a.
  PENDULA_IN_REGISTERS void run_out() {
    Cartesian w = zero();
    for (int i = 0; i < links(); ++i) {
      Cartesian u_dot;
      Link::velocity(trig(i), rates(i), u_dot);
      w = sum(w, scaled(L(constants_[i].length), to_world(charts_[i], u_dot)));
      store_each(w, w_[i]);
    }
  }

  /// Forces f of the stages that V places, which Newton on V alone leaves behind.
  void find_forces() {
    place();
    run_out();
    set_all_forces();
  }

  /// Forces f at the placed stages, from the velocities of the bobs: f_a = y_a·(l G) + û_a·R.
  void set_all_forces() {
    Cartesian G = zero();
    for (int i = links(); i-- > 0;) {
      G = sum(G, scaled(L(constants_[i].mass), bob_velocity(i)));
      const Trig at = trig(i);
      const Coordinates v = rates(i);
      Coordinates f;
      Link::force(at, v, to_chart(charts_[i], scaled(L(constants_[i].length), G)), load(i, charts_[i], at, v), f);
      set_forces(i, f);
    }
  }

  /// What the end of the step would have; the state stays where it is.
  double unexplained_energy() {
    const EnergyTally<Space, Real> start = loaded() ? tally_at_state() : run_start_;
    for_each_saved(tried_, [](Real& kept, Real& value) { kept = value; });
    move();
    const EnergyTally<Space, Real> end = tally_at_state();
    for_each_saved(tried_, [](Real& kept, Real& value) { value = kept; });
    return pendula::unexplained_energy(chain_, start, end);
  }

  /// Moves the state to the end of the step, and links that come near a pole to their other chart.
  void accept(bool forces_are_predicted) {
    move();
    last_h_ = step_;
    if constexpr (has_charts<Space>) change_charts(forces_are_predicted);
  }

  /// The next step starts cold.
  void forget() { last_h_ = 0; }

  State<Space, N, Real> state(double time) const {
    State<Space, N, Real> state;
    state.time = time;
    state.q.resize(Space::dof * links());
    state.v.resize(Space::dof * links());
    MotionSweep<Space, Real, N> sweep(links());
    sweep_state(sweep, [&](int i, const Rates& v, const Rates&) {
      const LinkAngles<Space, Real> angles = read(i, v);
      for (std::size_t a = 0; a < K; ++a) {
        state.q[entry(i, a)] = angles.q[a];
        state.v[entry(i, a)] = angles.v[a];
      }
    });
    return state;
  }

  /// Keeps the state, to go back to where a step has to be given up half-way.
  void save() {
    saved_.charts = charts_;
    saved_.user = user_;
    for_each_saved(saved_.numbers, [](Real& kept, Real& value) { kept = value; });
  }

  void restore() {
    charts_ = saved_.charts;
    user_ = saved_.user;
    for_each_saved(saved_.numbers, [](Real& kept, Real& value) { value = kept; });
    forget();
  }

 private:
  using Rates = std::array<Real, K>;
  using PlainTrig = typename Link::template Trig<Real>;
  using PlainCartesian = typename Link::template Cartesian<Real>;

  // Farther than this the polynomial of the last step is no prediction.
  static constexpr double farthest_extrapolation = 1.5;

  // Links whose sines fill a few of the widest registers. Angles are stored in narrower ones, and a processor does not
  // hand those on: the first have reached memory when the last are written. More would leave the sweep nothing to do
  // while it waits for divisions.
  static constexpr std::size_t angles_at_once = 32;
  static constexpr int placed_at_once =
      detail::has_registers<Real> && K * Z < angles_at_once ? static_cast<int>(angles_at_once / (K * Z)) : 1;

  // On few links nothing else is done meanwhile, and gathering costs more than it saves. Not where the stages take
  // several registers, which their sines would leave too few of. (On 20 to 100 links, gathering takes 5 to 15 % less.)
  static constexpr int placed_one_by_one = static_cast<int>(Z) <= detail::register_size<RegisterFor<8, Real>> ? 4 : 0;

  // Hands on the stages of an angle, rounded sums, and what they lost: most where links have turned often. (Returned in
  // a struct, compilers send packs of several registers through memory.)
  template <class Take>
  void take_angle(int i, std::size_t a, Take take) const {
    const L q(q_[i][a]), moved = columns_.integral(L::load(V_[i] + a * Z)) + L(q_low_[i][a]);
    const L placed = q + moved;
    take(placed, (q - placed) + moved);
  }

  void set_trig(int i, std::size_t a, const L& sine, const L& cosine, const L& low) {
    fma(cosine, low, sine).store(sine_[i] + a * Z);
    (cosine - sine * low).store(cosine_[i] + a * Z);
  }

  void place_one_by_one(int begin, int end) {
    for (int i = begin; i < end; ++i) {
      for (std::size_t a = 0; a < K; ++a) {
        take_angle(i, a, [&](const L& angle, const L& low) {
          L sine, cosine;
          sincos(angle, sine, cosine);
          set_trig(i, a, sine, cosine, low);
        });
      }
    }
  }

  void place_together(int begin, int end) {
    alignas(pack_alignment) Real Q[placed_at_once * K * Z], Q_low[placed_at_once * K * Z];
    const auto count = static_cast<std::size_t>(end - begin) * K * Z;
    if (end - begin < placed_at_once) std::fill(Q + count, Q + std::min(count + 8, placed_at_once * K * Z), Real(0));
    const auto at = [&](int i, std::size_t a) { return (static_cast<std::size_t>(i - begin) * K + a) * Z; };
    for (int i = begin; i < end; ++i) {
      for (std::size_t a = 0; a < K; ++a) {
        take_angle(i, a, [&](const L& angle, const L& low) {
          angle.store(Q + at(i, a));
          low.store(Q_low + at(i, a));
        });
      }
    }
    // Past the last link of the chain this writes what nobody reads.
    sincos_all(Q, sine_[begin], cosine_[begin], static_cast<std::ptrdiff_t>(count));
    for (int i = begin; i < end; ++i) {
      for (std::size_t a = 0; a < K; ++a) {
        set_trig(i, a, L::load(sine_[i] + a * Z), L::load(cosine_[i] + a * Z), L::load(Q_low + at(i, a)));
      }
    }
  }

  struct Saved {
    detail::PerLink<Chart, N> charts;
    detail::PerLink<Rates, N> user;
    detail::LinkArray<4 * K, N, Real> numbers;
  };

  template <std::size_t Count>
  static std::array<L, Count> load_each(const Real* from) {
    std::array<L, Count> values;
    for (std::size_t k = 0; k < Count; ++k) values[k] = L::load(from + k * Z);
    return values;
  }
  template <std::size_t Count>
  static void store_each(const std::array<L, Count>& values, Real* to) {
    for (std::size_t k = 0; k < Count; ++k) values[k].store(to + k * Z);
  }
  static Cartesian zero() {
    Cartesian zero;
    zero.fill(L(Real(0)));
    return zero;
  }

  // Where coordinate a of link i stands in the user's vectors.
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * links() + i; }

  Rates momentum(int i) const {
    Rates p;
    for (std::size_t a = 0; a < K; ++a) p[a] = p_[i][a];
    return p;
  }

  Rates momentum_low(int i) const {
    Rates low;
    for (std::size_t a = 0; a < K; ++a) low[a] = p_low_[i][a];
    return low;
  }

  Rates position(int i) const {
    Rates q;
    for (std::size_t a = 0; a < K; ++a) q[a] = q_[i][a];
    return q;
  }

  void set_position(int i, const Rates& q) {
    for (std::size_t a = 0; a < K; ++a) {
      q_[i][a] = q[a];
      q_low_[i][a] = 0;
    }
  }

  void start_link(int i, const State<Space, N, Real>& state) {
    Rates q, v;
    for (std::size_t a = 0; a < K; ++a) {
      q[a] = state.q[entry(i, a)];
      v[a] = state.v[entry(i, a)];
    }
    charts_[i] = 0;
    user_[i] = q;
    PlainTrig trig;
    Link::trig(q, trig);
    if (has_charts<Space> && metric_determinant(trig) < chart_limit) {
      const Heading<Space, Real> heading(0, q, v);
      charts_[i] = 1;
      Link::coordinates(to_chart(Chart{1}, heading.u), q);
      Link::trig(q, trig);
      Link::rates(trig, 1 / metric_determinant(trig), to_chart(Chart{1}, heading.u_dot), v);
    }
    set_position(i, q);
    for (std::size_t a = 0; a < K; ++a) V_[i][a * Z] = v[a];
  }

  // p_a = l û_a·G from the rates that start_link left in the first lane.
  void set_momenta() {
    PlainCartesian w{}, G{};
    for (int i = 0; i < links(); ++i) {
      const Heading<Space, Real> heading(charts_[i], position(i), first_lane(V_[i]));
      w = sum(w, scaled(constants_[i].length, heading.u_dot));
      for (std::size_t k = 0; k < D; ++k) w_[i][k * Z] = w[k];
    }
    for (int i = links(); i-- > 0;) {
      for (std::size_t k = 0; k < D; ++k) G[k] += constants_[i].mass * w_[i][k * Z];
      const PlainCartesian momentum = to_chart(charts_[i], scaled(constants_[i].length, G));
      set_momentum(i, position(i), momentum);
    }
  }

  void set_momentum(int i, const Rates& q, const PlainCartesian& momentum) {
    PlainTrig trig;
    typename Link::template First<Real> u_a;
    Link::trig(q, trig);
    Link::direction_first(trig, u_a);
    for (std::size_t a = 0; a < K; ++a) {
      p_[i][a] = dot(u_a[a], momentum);
      p_low_[i][a] = 0;
    }
  }

  EnergyTally<Space, Real> tally_at_state() {
    EnergyTally<Space, Real> tally;
    sweep_state(at_state_, [&](int i, const Rates& v, const Rates&) {
      const Heading<Space, Real> heading(charts_[i], position(i), v);
      using std::abs, std::sqrt;
      Real squared_torque(0);
      if (loaded()) {
        for (const Real& component : first_torque(i)) squared_torque += component * component;
      }
      tally.add(chain_, i, heading, abs(h()) * sqrt(squared_torque * dot(heading.u_dot, heading.u_dot)));
    });
    return tally;
  }

  Heading<Space, Real> stage_heading(int i, std::size_t j) const {
    PlainTrig at;
    Link::trig_from(first_lane(sine_[i] + j), first_lane(cosine_[i] + j), at);
    return Heading<Space, Real>::of_trig(charts_[i], at, first_lane(V_[i] + j));
  }

  // Increments are added one by one: that keeps their sum's rounding in the low part.
  void move() {
    for (int i = 0; i < links(); ++i) {
      for (std::size_t a = 0; a < K; ++a) {
        for (std::size_t j = 0; j < S; ++j) {
          detail::add_compensated(columns_.hb(j) * V_[i][a * Z + j], q_[i][a], q_low_[i][a]);
          detail::add_compensated(columns_.hb(j) * F_[i][a * Z + j], p_[i][a], p_low_[i][a]);
        }
      }
    }
  }

  static Rates first_lane(const Real* from) {
    Rates values;
    for (std::size_t a = 0; a < K; ++a) values[a] = from[a * Z];
    return values;
  }

  static Real metric_determinant(const PlainTrig& trig) {
    Real determinant;
    Link::metric_determinant(trig, determinant);
    return determinant;
  }

  Placed<Space, Real> placed_at_state(int i) const {
    using std::cos, std::sin;
    Rates sine, cosine;
    for (std::size_t a = 0; a < K; ++a) {
      const Real s = sin(q_[i][a]), c = cos(q_[i][a]), low = q_low_[i][a];
      sine[a] = s + c * low;
      cosine[a] = c - s * low;
    }
    Placed<Space, Real> at{charts_[i], {}};
    Link::trig_from(sine, cosine, at.trig);
    return at;
  }

  // Rates and forces of every link at (q, p), one stage wide: visit(i, v, f).
  template <class Visit>
  void sweep_state(MotionSweep<Space, Real, N>& sweep, Visit visit) const {
    typename MotionSweep<Space, Real, N>::Inward inward;
    Placed<Space, Real> at;
    for (int i = links(); i-- > 0;) {
      at = placed_at_state(i);
      sweep.inward(inward, i, constants_[i], at, {momentum(i), momentum_low(i)});
    }
    typename MotionSweep<Space, Real, N>::Outward outward(at);
    Placed<Space, Real> next = at;
    for (int i = 0; i < links(); ++i, at = next) {
      if (i + 1 < links()) next = placed_at_state(i + 1);
      Rates v, f;
      sweep.outward(
          outward, i, constants_[i], at, next, momentum(i),
          [&](Chart, const Rates& rates) { return load_at_state(i, at.trig, rates); }, v, f);
      visit(i, v, f);
    }
  }

  PlainCartesian load_at_state(int i, const PlainTrig& trig, const Rates& v) const {
    PlainCartesian load = to_chart(charts_[i], constants_.template weight<Real>(i));
    if (loaded()) constants_.add_loads(i, to_chart(charts_[i], first_torque(i)), trig, v, load);
    return load;
  }

  typename Link::template Torque<Real> first_torque(int i) const {
    typename Link::template Torque<Real> torque;
    for (std::size_t k = 0; k < Space::torque_components; ++k) torque[k] = torque_[i][k * Z];
    return torque;
  }

  void set_constant_torque(int i) {
    for (std::size_t k = 0; k < Space::torque_components; ++k) {
      L(Real(chain_.constant_torque()(static_cast<Eigen::Index>(k), i))).store(torque_[i] + k * Z);
    }
  }

  void set_driven_torques(double time) {
    using std::sin;
    for (const Drive<Space>& drive : chain_.drives()) set_constant_torque(drive.link);
    for (const Drive<Space>& drive : chain_.drives()) {
      for (std::size_t j = 0; j < S; ++j) {
        const Real wave = sin(Real(drive.frequency) * (Real(time) + columns_.hc(j)) + Real(drive.phase));
        for (std::size_t k = 0; k < Space::torque_components; ++k) {
          torque_[drive.link][k * Z + j] += wave * Real(drive.amplitude[static_cast<Eigen::Index>(k)]);
        }
      }
    }
  }

  LinkAngles<Space, Real> read(int i, const Rates& v) const {
    if constexpr (has_charts<Space>) {
      if (charts_[i] == 1) return user_angles(Heading<Space, Real>(1, position(i), v), user_[i]);
    }
    return {position(i), v};
  }

  // --- Charts ---

  void change_charts(bool forces_are_predicted) {
    bool changed = false;
    for (int i = 0; i < links(); ++i) {
      if (charts_[i] == 1) follow(i);
      if (last_determinant(i) >= chart_limit) continue;
      change_chart(i);
      changed = true;
    }
    if (!changed || !forces_are_predicted) return;
    run_out();
    set_all_forces();
  }

  // The user's angles of a link in chart 1 at the last stage, kept up so that they stay continuous.
  void follow(int i) { user_[i] = user_coordinates(stage_heading(i, S - 1), user_[i]); }

  Rates last_rates(int i) const { return first_lane(V_[i] + (S - 1)); }

  Real last_determinant(int i) const {
    L determinant;
    Link::metric_determinant(trig(i), determinant);
    alignas(pack_alignment) Real stages[Z];
    determinant.store(stages);
    return stages[S - 1];
  }

  // Moves position and momentum to the other chart, and the stage velocities from which the next step is predicted.
  void change_chart(int i) {
    const Chart from = charts_[i], to = static_cast<Chart>(1 - from);
    const Rates q = position(i);
    PlainTrig trig;
    PlainCartesian across;
    Rates p;
    for (std::size_t a = 0; a < K; ++a) p[a] = p_[i][a] + p_low_[i][a];
    Link::trig(q, trig);
    Link::tangent_momentum(trig, 1 / metric_determinant(trig), p, across);
    const Heading<Space, Real> heading(from, q, last_rates(i));
    user_[i] = from == 0 ? q : user_coordinates(heading, user_[i]);
    Rates moved;
    if (to == 0) {
      moved = user_[i];
    } else {
      Link::coordinates(to_chart(to, heading.u), moved);
    }
    set_position(i, moved);
    set_momentum(i, moved, to_chart(to, to_world(from, across)));
    for (std::size_t j = 0; j < S; ++j) change_stage(i, j, to);
    charts_[i] = to;
    ++chart_switches_;
  }

  void change_stage(int i, std::size_t j, Chart to) {
    using std::cos, std::sin;
    const Heading<Space, Real> heading = stage_heading(i, j);
    LinkAngles<Space, Real> angles;
    if (to == 0) {
      angles = user_angles(heading, user_[i]);
    } else {
      PlainTrig trig;
      Link::coordinates(to_chart(to, heading.u), angles.q);
      Link::trig(angles.q, trig);
      Link::rates(trig, 1 / metric_determinant(trig), to_chart(to, heading.u_dot), angles.v);
    }
    for (std::size_t a = 0; a < K; ++a) {
      V_[i][a * Z + j] = angles.v[a];
      sine_[i][a * Z + j] = sin(angles.q[a]);
      cosine_[i][a * Z + j] = cos(angles.q[a]);
    }
  }

  template <class Copy>
  void for_each_saved(detail::LinkArray<4 * K, N, Real>& numbers, Copy copy) {
    for (int i = 0; i < links(); ++i) {
      Real* kept = numbers[i];
      for (auto* values : {&q_, &q_low_, &p_, &p_low_}) {
        for (std::size_t a = 0; a < K; ++a) copy(*kept++, (*values)[i][a]);
      }
    }
  }

  Chain<Space, N> chain_;
  ChainLinks<Space, N, Real> constants_;
  detail::StageColumns<S, Real> columns_;
  detail::PerLink<Chart, N> charts_;
  detail::PerLink<Rates, N> user_;  // the user's angles of links in chart 1, shortly before
  detail::LinkArray<K, N, Real> q_, q_low_, p_, p_low_;
  detail::LinkArray<K * Z, N, Real> V_, F_, sine_, cosine_;
  detail::LinkArray<D * Z, N, Real> w_;
  detail::LinkArray<Space::torque_components * Z, N, Real> torque_;
  MotionSweep<Space, Real, N> at_state_;
  EnergyTally<Space, Real> run_start_;
  Saved saved_;
  detail::LinkArray<4 * K, N, Real> tried_;  // the state, while the end of a step is looked at
  double step_ = 0;                          // of the stages
  double last_h_ = 0;                        // of the step that V and F belong to; 0: they belong to none
  std::int64_t chart_switches_ = 0;
};

}  // namespace pendula

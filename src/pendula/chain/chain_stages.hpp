#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/chain/rod_state.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/gauss/stage_columns.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/numeric/lanes.hpp>
#include <xsimd/xsimd.hpp>

namespace pendula {

/// What both iterations on the stages of a chain share: the state, the stage values, predictor and update.
///
/// The field on rods ξ and free rates z (rod_state.hpp) is
///   ξ̇_i = z_i + e_i − e_{i−1},           e_i = (τ_i ξ_i − τ_{i+1} ξ_{i+1})/m_i,      e_0 = 0,
///   ż_i = d_i − d_{i−1} − δ_{i1} g up,    d_i = −(τ_i ξ̇_i − τ_{i+1} ξ̇_{i+1})/m_i,    d_0 = 0,
/// where damping and torque join τ_i ξ̇_i as (λ_i ξ̇_i − torque_i × ξ_i)/l_i². Every Gauss method keeps |ξ_i|² and the
/// vertical angular momentum, which are quadratic, and is symplectic: there is no pole and no drift (docs/method.md).
///
/// Stages are held as increments U = h b (ξ̇ − z) and W = h b (ż + δ_{i1} g up), so that what is large enters exactly:
///   X = ξ + h c z + m U,  Z = z − δ_{i1} h c g up + m W,  m_ij = a_ij/b_j.
///
/// Multipliers grow through a step as tension does, and where they grow too far the stage equations fold: with two
/// stages at h ω = √12, ω what the chain swings with. Of a step so long, M |g|/l ξ joins τ ξ̇: that is of H the term
/// Σ M |g|/l (|ξ|² − l²)/2, which is zero on the motion, and of a chain at rest nothing is left for τ. Then any
/// swinging goes through any step, as it does in angles.
///
/// All stages of one number are a Lanes<S, Real>, everything is done for all of them at once.
template <class Space, int S, int N = Eigen::Dynamic, class Real = double, class Arch = xsimd::default_arch>
class ChainStages {
 public:
  using L = Lanes<S, Real>;
  static constexpr std::size_t D = Space::dimension, Z = L::size;
  using Vector = std::array<L, D>;  ///< one vector at all stages
  using Numbers = std::array<Real, D>;

  explicit ChainStages(const Chain<Space, N>& chain, Family family = Family::gauss)
      : chain_(chain),
        constants_(chain),
        columns_(family),
        restoring_interval_(family == Family::gauss ? 16 : 1),
        state_(constants_),
        anchors_(chain.links()),
        stages_(chain.links()),
        torque_(chain.loaded() ? chain.links() : 0) {}

  int links() const { return constants_.links(); }
  const Chain<Space, N>& chain() const { return chain_; }
  const LinkConstants<Real>& constants(int i) const { return constants_[i]; }
  const detail::StageColumns<S, Real>& columns() const { return columns_; }
  const RodState<Space, N, Real>& rods() const { return state_; }
  bool loaded() const { return constants_.loaded(); }
  Real h() const { return columns_.h(); }

  // --- Values of one link at all stages ---

  Vector increments(int i) const { return load_vector(stages_[i]); }
  void set_increments(int i, const Vector& U) { store_vector(U, stages_[i]); }
  L multiplier(int i) const { return L::load(stages_[i] + multiplier_at); }
  void set_multiplier(int i, const L& tau) { tau.store(stages_[i] + multiplier_at); }

  /// Where a rod is at the stages, and what acts along the chain there.
  struct Placed {
    Vector rod;    ///< X
    Vector moved;  ///< X − ξ
    Vector pull;   ///< h b times what τ ξ̇, damping and torque add up to
  };

  Placed place(int i) const {
    const Real *along = state_.along(i), *along_low = state_.along_low(i), *free = state_.free(i);
    const L hb = columns_.hb(), hc = columns_.hc(), hc_low = columns_.hc_low();
    const L tau = multiplier(i);
    Placed placed;
    for (std::size_t k = 0; k < D; ++k) {
      const Real* U = stages_[i] + k * Z;
      const L z(free[k]);
      placed.moved[k] = fma(hc, z, columns_.integral(U, fma(hc_low, z, L(along_low[k]))));
      placed.rod[k] = L(along[k]) + placed.moved[k];
      placed.pull[k] = tau * fma(hb, z, L::load(U));
    }
    if (loaded()) add_loads(i, placed);
    if (hangs_) add_hanging(i, placed);
    return placed;
  }

  /// h b ξ̇.
  Vector advance(int i) const {
    const L hb = columns_.hb();
    return components<D>([&](std::size_t k) { return fma(hb, L(state_.free(i)[k]), L::load(stages_[i] + k * Z)); });
  }

  /// Σ_j h a_kj f(j) of what acts on a rod but its multiplier, rods at the stages being X.
  Vector impulse_without_multiplier(int i, const Vector& X) const {
    Vector impulse = zero();
    if (loaded() || hangs_) {
      Placed placed{X, {}, impulse};
      if (loaded()) add_loads(i, placed);
      if (hangs_) add_hanging(i, placed);
      for (std::size_t k = 0; k < D; ++k) impulse[k] = -columns_.integral(placed.pull[k]);
    }
    impulse[D - 1] = impulse[D - 1] - columns_.hc() * L(constants_[i].weight);
    return impulse;
  }

  /// Z − z, from W.
  Vector freed(int i, const Vector& W) const {
    Vector freed = components<D>([&](std::size_t k) { return columns_.integral(W[k], L(state_.free_low(i)[k])); });
    if (i == 0) freed[D - 1] = freed[D - 1] - columns_.hc() * L(Real(chain_.gravity()));
    return freed;
  }

  /// What the rod pulls beside its multiplier, over its length: of a step that does not resolve how fast the chain can
  /// swing, the tension of a chain at rest; otherwise nothing.
  Real hanging(int i) const { return hangs_ ? constants_[i].hanging : Real(0); }

  /// Torque on link i, times h b / l².
  auto torque(int i) const {
    return components<Space::torque_components>([&](std::size_t k) { return L::load(torque_[i] + k * Z); });
  }

  // --- What the fixed point keeps from its way in to its way out ---

  void keep(int i, const Vector& rod, const Vector& freed, const MultiplierRow<L>& row) {
    store_vector(rod, stages_[i] + rod_at);
    store_vector(freed, stages_[i] + freed_at);
    row.offset.store(stages_[i] + offset_at);
    row.coupling.store(stages_[i] + coupling_at);
  }
  Vector kept_rod(int i) const { return load_vector(stages_[i] + rod_at); }
  Vector kept_freed(int i) const { return load_vector(stages_[i] + freed_at); }
  MultiplierRow<L> kept_row(int i) const {
    return {L::load(stages_[i] + offset_at), L::load(stages_[i] + coupling_at)};
  }

  // --- A step ---

  void start(const State<Space, N, Real>& state) {
    forget();
    steps_ = 0;
    fastest_ = 0;
    for (int i = 0; i < links(); ++i) {
      std::array<Real, Space::dof> q, v;
      for (std::size_t a = 0; a < q.size(); ++a) {
        q[a] = state.q[entry(i, a)];
        v[a] = state.v[entry(i, a)];
      }
      state_.start(i, constants_[i].length, q, v);
      anchors_[i].set(state_.direction(i, constants_[i].inverse_length), q);
    }
  }

  /// Predicts the stages of a step of size h: from the last step's, or cold where there was none like it.
  void prepare(double time, double h) {
    const bool alike = last_h_ != 0 && std::abs(h / last_h_) < farthest_extrapolation;
    const bool other = Real(h) != columns_.h();
    columns_.prepare(Real(h), Real(alike ? last_h_ : 0));
    if (loaded() && (other || chain_.driven() || !torque_is_set_)) set_torques(time);
    hangs_ = !constants_.resolves(Real(h));
    is_predicted_ = alike;
    if (alike) {
      predict();
    } else {
      start_cold();
    }
    last_h_ = 0;  // what was predicted from is gone until the step is accepted
    step_ = h;
  }

  /// Predicts the stages of another step from where the last one began that was solved, accepted or not: from that
  /// one's.
  void prepare_again(double time, double h) {
    const double from = last_h_ != 0 ? last_h_ : step_;
    columns_.predict_at(Real(0), Real(h / from));
    columns_.prepare(Real(h), Real(0));
    if (loaded()) set_torques(time);
    hangs_ = !constants_.resolves(Real(h));
    is_predicted_ = hangs_ != constants_.resolves(Real(from));
    if (is_predicted_) {
      for (int i = 0; i < links(); ++i) {
        for (std::size_t k = 0; k < D; ++k)
          columns_.extrapolated_increments(stages_[i] + k * Z).store(stages_[i] + k * Z);
        columns_.extrapolated(stages_[i] + multiplier_at).store(stages_[i] + multiplier_at);
      }
    } else {
      start_cold();
    }
    step_ = h;
  }

  /// Stages of a motion that goes on as at the start of the step: with the multipliers there taken into the free rates,
  /// they are the rates.
  void start_cold() {
    state_.for_each_rate(constants_, [&](int i, const Numbers&, const Real& tau) { stages_[i][multiplier_at] = tau; });
    state_.shift_gauge([&](int i) { return stages_[i][multiplier_at]; },
                       [&](int i, const Real&, const Real*) {
                         for (std::size_t k = 0; k <= D; ++k) L(Real(0)).store(stages_[i] + k * Z);
                       });
    last_h_ = 0;
  }

  /// The most that a link turns in the step, as the iterations on the stages find it  [rad].
  double turn() const { return turn_; }
  void set_turn(double turn) { turn_ = turn; }

  /// Energy that the end of the step would have, less that of its start and what loads bring; in units of all that the
  /// chain has, kinetic and Σ M |g| l. Zero but for truncation on the motion.
  double energy_defect() {
    const Energy start = energy();
    const double brought = loaded() ? static_cast<double>(work()) : 0;
    state_.save(trial);
    move();
    const Energy end = energy();
    state_.restore(trial);
    return static_cast<double>(end.total() - start.total() - brought) / scale_of(start, brought);
  }

  /// How far, at the start of the step, the polynomial through the stages' rates is off, of bobs, relative to the
  /// fastest that there was.
  double defect() {
    using std::sqrt;
    Numbers bob{}, missed{}, last{};
    Real furthest(0);
    state_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      for (std::size_t k = 0; k < D; ++k) {
        const Real* U = stages_[i] + k * Z;
        const Real& z = state_.free(i)[k];
        bob[k] += rate[k];
        missed[k] += z + columns_.at_start(U) - rate[k];
        last[k] += z + (columns_.h() == 0 ? Real(0) : Real(U[S - 1] / columns_.hb(S - 1)));
      }
      furthest = std::max(furthest, dot(missed, missed));
      fastest_ = std::max({fastest_, static_cast<double>(dot(bob, bob)), static_cast<double>(dot(last, last))});
    });
    return furthest > 0 ? std::sqrt(static_cast<double>(furthest) / fastest_) : 0;
  }
  double predictor_gain() const { return is_predicted_ ? static_cast<double>(columns_.predictor_gain()) : 1; }

  /// Of the state: R² = κ + (Σ ω_i⁸)^(1/4), ω_i what rod i turns with and κ what gravity moves a long chain by. Loads
  /// have no part in how R grows: only steps that are symmetric ask for that.
  Tempo tempo() const {
    Real sum(0), growth(0);
    state_.for_each_acceleration(constants_, Real(chain_.gravity()),
                                 [&](int i, const Numbers& rate, const Numbers& acceleration) {
                                   const Real squared = dot(rate, rate) * constants_[i].inverse_square;
                                   const Real sixth = squared * squared * squared;
                                   sum += sixth * squared;
                                   growth += sixth * dot(rate, acceleration) * constants_[i].inverse_square;
                                 });
    const auto total = static_cast<double>(sum);
    const double squared = slowest_pace() + std::pow(total, 0.25);
    return {std::sqrt(squared), total > 0 ? std::pow(total, -0.75) * static_cast<double>(growth) / squared : 0};
  }

  /// Of the stages as they were solved.
  PENDULA_IN_REGISTERS StepShape shape() const {
    L quartic(Real(0)), decay(Real(0));
    alignas(pack_alignment) Real inverse[Z] = {};
    for (std::size_t j = 0; j < S; ++j) inverse[j] = columns_.h() == 0 ? Real(0) : Real(1 / columns_.hb(j));
    const L inverse_hb = L::load(inverse), inverse_squared = inverse_hb * inverse_hb;
    for (int i = 0; i < links(); ++i) {
      const L inverse_square(constants_[i].inverse_square);
      const Vector advanced = advance(i);
      const L squared = inverse_squared * inverse_square * dot(advanced, advanced);
      quartic = fma(squared * squared, squared * squared, quartic);
      L coefficients(Real(0));
      for (std::size_t k = 0; k < D; ++k) {
        alignas(pack_alignment) Real stored[Z];
        advanced[k].store(stored);
        const L a = columns_.legendre(stored);
        coefficients = fma(a, a, coefficients);
      }
      decay = max(decay, coefficients * inverse_square);
    }
    StepShape shape = shape_of(quartic, decay);
    if (S == StepShape::few_stages && loaded()) shape.beyond = missed_at_start();
    return shape;
  }

  /// Energy that torque and damping bring in the step  [J].
  Real work() const {
    Real work(0);
    for (int i = 0; i < links(); ++i) {
      Placed placed{kept_rod(i), {}, zero()};
      add_loads(i, placed);
      const Vector advanced = advance(i);
      alignas(pack_alignment) Real power[Z];  // times (h b)²
      dot(placed.pull, advanced).store(power);
      for (std::size_t j = 0; j < S; ++j) work -= power[j] == 0 ? Real(0) : Real(power[j] / columns_.hb(j));
    }
    return work;
  }

  /// Moves the state to the end of the step.
  void accept() {
    follow_turns();
    move();
    ++steps_;
    if (steps_ % restoring_interval_ == 0) {
      for (int i = 0; i < links(); ++i) state_.restore_length(i, constants_[i].length);
    }
    for (int i = 0; i < links(); ++i) anchors_[i].follow(state_.direction(i, constants_[i].inverse_length));
    last_h_ = step_;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(state_, last_h_, fastest_, steps_);
    for (int i = 0; i < links(); ++i) {
      numbers(anchors_[i]);
      numbers.range(stages_[i], (D + 1) * Z);
    }
  }

  /// The next step starts cold.
  void forget() { last_h_ = 0; }

  State<Space, N, Real> state(double time) const {
    State<Space, N, Real> state = empty_state(time);
    state_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      read_angles(i, state_.heading(i, rate), anchors_[i], state);
    });
    return state;
  }

  /// Remembers the start of the step; goes back there, the stages still known.
  void remember() {
    state_.remember();
    remembered_anchors_ = anchors_;
  }
  void return_to_start() {
    state_.return_to_remembered();
    anchors_ = remembered_anchors_;
  }

  /// The state at x of the last step, by the polynomials through its rates.
  State<Space, N, Real> glance(double time, double x) const {
    State<Space, N, Real> state = empty_state(time);
    const Real h(last_h_);
    const auto rate_at = columns_.rate_at(Real(x), h), up_to = columns_.up_to(Real(x));
    for (int i = 0; i < links(); ++i) {
      const Real *along = state_.remembered_along(i), *z = state_.remembered_free(i);
      const Numbers rate = components<D>([&](std::size_t k) { return z[k] + weighed(rate_at, stages_[i] + k * Z); });
      const Numbers rod = rod_in_step(along, z, i, Real(h * Real(x)), up_to), low{};
      AngleAnchor<Space, Real> anchor = remembered_anchors_[i];
      if (may_leave(anchor, i, along, turn_ * std::abs(x))) follow_turn(anchor, along, z, i, h, Real(x), rod);
      read_angles(i, RodState<Space, N, Real>::heading_of(rod.data(), low.data(), rate), anchor, state);
    }
    return state;
  }

  /// Keeps the state, to go back to where a step has to be given up half-way.
  void save() {
    state_.save(parts);
    saved_anchors_ = anchors_;
  }
  void restore() {
    state_.restore(parts);
    anchors_ = saved_anchors_;
    forget();
  }

 private:
  // Farther than this the polynomial of the last step is no prediction.
  static constexpr double farthest_extrapolation = 1.5;
  // Where in the block of a link what stands; [number][stage].
  static constexpr std::size_t multiplier_at = D * Z, rod_at = (D + 1) * Z, freed_at = (2 * D + 1) * Z,
                               offset_at = (3 * D + 1) * Z, coupling_at = (3 * D + 2) * Z, per_link = (3 * D + 3) * Z;

  // What the state is kept for: RodState::save.
  static constexpr std::size_t parts = 0, trial = 1;

  static Vector zero() {
    return components<D>([](std::size_t) { return L(Real(0)); });
  }
  static Vector load_vector(const Real* from) {
    return components<D>([&](std::size_t k) { return L::load(from + k * Z); });
  }
  static void store_vector(const Vector& x, Real* to) {
    for (std::size_t k = 0; k < D; ++k) x[k].store(to + k * Z);
  }

  using Weights = typename detail::StageColumns<S, Real>::Weights;
  static Real weighed(const Weights& weights, const Real* x) {
    Real sum(0);
    for (std::size_t j = 0; j < S; ++j) sum += weights[j] * x[j];
    return sum;
  }

  State<Space, N, Real> empty_state(double time) const {
    State<Space, N, Real> state;
    state.time = time;
    state.q.resize(Space::dof * links());
    state.v.resize(Space::dof * links());
    return state;
  }

  template <class LinkHeading>
  void read_angles(int i, const LinkHeading& heading, const AngleAnchor<Space, Real>& anchor,
                   State<Space, N, Real>& state) const {
    using Wide = typename decltype(heading.u)::value_type;
    std::array<Wide, Space::dof> near;
    for (std::size_t a = 0; a < near.size(); ++a) near[a] = Wide(anchor.angles()[a]);
    const auto angles = user_angles(heading, near);
    for (std::size_t a = 0; a < near.size(); ++a) {
      state.q[entry(i, a)] = Real(angles.q[a]);
      state.v[entry(i, a)] = Real(angles.v[a]);
    }
  }

  // Where coordinate a of link i stands in the user's vectors.
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * links() + i; }

  void add_loads(int i, Placed& placed) const {
    const L drag(constants_[i].drag);
    const Vector advanced = advance(i);
    Vector turning;
    Space::Link::torque_load(torque(i), placed.rod, turning);
    for (std::size_t k = 0; k < D; ++k) {
      placed.pull[k] = placed.pull[k] + (drag * advanced[k] - turning[k]);
    }
  }

  void add_hanging(int i, Placed& placed) const {
    const L tension = columns_.hb() * L(constants_[i].hanging);
    for (std::size_t k = 0; k < D; ++k) placed.pull[k] = fma(tension, placed.rod[k], placed.pull[k]);
  }

  double slowest_pace() const {
    const double length = static_cast<double>(chain_.lengths().sum());
    return 0.15 * links() * links() * std::abs(chain_.gravity()) / length;
  }

  StepShape shape_of(const L& quartic, const L& decay) const {
    alignas(pack_alignment) Real paces[Z], squares[Z];
    quartic.store(paces);
    decay.store(squares);
    StepShape shape;
    for (std::size_t k = 0; k < S; ++k) shape.decay[k] = std::sqrt(static_cast<double>(squares[k]));
    shape.pace = std::sqrt(slowest_pace() + std::pow(static_cast<double>(paces[S / 2]), 0.25));
    return shape;
  }

  // By how much the polynomials through the stages' rates are off at the start of the step, times h, relative to the
  // length of the rod.
  double missed_at_start() const {
    using std::sqrt;
    Real furthest(0);
    state_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      const Numbers missed = components<D>(
          [&](std::size_t k) { return state_.free(i)[k] + columns_.at_start(stages_[i] + k * Z) - rate[k]; });
      furthest = std::max(furthest, dot(missed, missed) * constants_[i].inverse_square);
    });
    return std::abs(step_) * static_cast<double>(sqrt(furthest));
  }

  void set_torques(double time) {
    using std::sin;
    for (int i = 0; i < links(); ++i) {
      const L scale = columns_.hb() * L(constants_[i].inverse_square);
      for (std::size_t k = 0; k < Space::torque_components; ++k) {
        (scale * L(Real(chain_.constant_torque()(static_cast<Eigen::Index>(k), i)))).store(torque_[i] + k * Z);
      }
    }
    for (const Drive<Space>& drive : chain_.drives()) {
      for (std::size_t j = 0; j < S; ++j) {
        const Real at = Real(time) + columns_.h() * columns_.c(j);
        const Real wave = sin(Real(drive.frequency) * at + Real(drive.phase)) * columns_.hb(j) *
                          constants_[drive.link].inverse_square;
        for (std::size_t k = 0; k < Space::torque_components; ++k) {
          torque_[drive.link][k * Z + j] += wave * Real(drive.amplitude[static_cast<Eigen::Index>(k)]);
        }
      }
    }
    torque_is_set_ = true;
  }

  // Multipliers of the middle of the step go into the free rates: what is left of them at the stages is as often
  // positive as negative, and so is what it is rounded by.
  PENDULA_IN_REGISTERS void predict() {
    const L hb = columns_.hb();
    state_.shift_gauge([&](int i) { return columns_.at_half(stages_[i] + multiplier_at); },
                       [&](int i, const Real& lambda, const Real* change) {
                         for (std::size_t k = 0; k < D; ++k) {
                           Real* U = stages_[i] + k * Z;
                           (columns_.extrapolated_increments(U) - hb * L(change[k])).store(U);
                         }
                         Real* tau = stages_[i] + multiplier_at;
                         (columns_.extrapolated(tau) - L(lambda)).store(tau);
                       });
  }

  // Σ_j of a stored number over the stages.
  static Real total(const Real* x) {
    Real sum = x[0];
    for (std::size_t j = 1; j < S; ++j) sum += x[j];
    return sum;
  }
  static Numbers totals(const Vector& x) {
    return components<D>([&](std::size_t k) {
      alignas(pack_alignment) Real stored[Z];
      x[k].store(stored);
      return total(stored);
    });
  }

  // Placed rods are those that the last iteration used.
  Numbers total_pull(int i) const {
    Placed placed;
    placed.rod = kept_rod(i);
    const L tau = multiplier(i);
    const Vector advanced = advance(i);
    for (std::size_t k = 0; k < D; ++k) placed.pull[k] = tau * advanced[k];
    if (loaded()) add_loads(i, placed);
    if (hangs_) add_hanging(i, placed);
    return totals(placed.pull);
  }

  void move() {
    static constexpr int block = RodState<Space, N, Real>::block;
    alignas(pack_alignment) Real moved[block * D], pushed[block * D];
    Numbers pull = total_pull(0), before{};
    for (int begin = 0; begin < links(); begin += block) {
      std::fill(std::begin(moved), std::end(moved), Real(0));
      std::fill(std::begin(pushed), std::end(pushed), Real(0));
      for (int i = begin; i < std::min(begin + block, links()); ++i) {
        const Numbers next = i + 1 < links() ? total_pull(i + 1) : Numbers{};
        const Numbers bond = scaled(constants_[i].inverse_mass.value, difference(next, pull));
        const Numbers gained = difference(bond, before), gone = totals(increments(i));
        std::copy_n(gone.data(), D, moved + static_cast<std::size_t>(i - begin) * D);
        std::copy_n(gained.data(), D, pushed + static_cast<std::size_t>(i - begin) * D);
        before = bond;
        pull = next;
      }
      state_.advance(begin, columns_.h(), moved, pushed);
    }
    state_.fall(columns_.h(), Real(chain_.gravity()));
  }

  struct Energy {
    Real kinetic{0}, potential{0};
    Real total() const { return kinetic + potential; }
  };

  Energy energy() const {
    Energy energy;
    Numbers bob{};
    state_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      bob = sum(bob, rate);
      energy.kinetic += constants_[i].mass * dot(bob, bob) / 2;
      energy.potential += constants_[i].weight * state_.along(i)[D - 1];
    });
    return energy;
  }

  double scale_of(const Energy& start, double brought) const {
    const double scale = static_cast<double>(start.kinetic) + energy_scale(chain_) + std::abs(brought);
    return scale > 0 ? scale : 1;
  }

  // Of the step whose stages are known, from a rod on with z: the rod after some of the time, for which `up_to` is.
  Numbers rod_in_step(const Real* along, const Real* z, int i, const Real& time, const Weights& up_to) const {
    return components<D>([&](std::size_t k) { return along[k] + (time * z[k] + weighed(up_to, stages_[i] + k * Z)); });
  }

  // Whether a link may turn so far from where a step began that its anchor does not hold it.
  bool may_leave(const AngleAnchor<Space, Real>& anchor, int i, const Real* along, double turn) const {
    using std::sqrt;
    const Numbers off =
        components<D>([&](std::size_t k) { return along[k] * constants_[i].inverse_length - anchor.direction()[k]; });
    const Real farthest = sqrt(dot(off, off)) + Real(1.5 * turn);
    return farthest * farthest > anchor.reach_squared();
  }

  // Takes an anchor from a rod on through the stages to x of the step, where it is at `end`; where the stages are too
  // far apart for that, by a pole, along the polynomial through them.
  void follow_turn(AngleAnchor<Space, Real>& anchor, const Real* along, const Real* z, int i, const Real& h,
                   const Real& x, const Numbers& end) const {
    const Real& inverse_length = constants_[i].inverse_length;
    alignas(pack_alignment) Real u[D][2 * Z];
    L squared(Real(0));
    for (std::size_t k = 0; k < D; ++k) {
      const L moved = columns_.integral(stages_[i] + k * Z, L(h * z[k]) * columns_.c());
      const L direction = L(inverse_length) * (L(along[k]) + moved), off = direction - L(anchor.direction()[k]);
      direction.store(u[k]);
      squared = fma(off, off, squared);
    }
    std::size_t before = 0;
    while (before < S && columns_.c(before) < x) ++before;
    Real farthest(0);
    for (std::size_t k = 0; k < D; ++k) {
      u[k][before] = inverse_length * end[k];
      const Real off = u[k][before] - anchor.direction()[k];
      farthest += off * off;
    }
    alignas(pack_alignment) Real stored[Z];
    squared.store(stored);
    for (std::size_t j = 0; j < before; ++j) farthest = std::max(farthest, stored[j]);
    if (farthest <= anchor.reach_squared() || anchor.follow_through(u, before + 1)) return;
    const auto direction_at = [&](const Real& at) {
      return scaled(inverse_length, rod_in_step(along, z, i, h * at, columns_.up_to(at)));
    };
    anchor.follow_path(direction_at, x);
  }

  // Of the step that is solved.
  void follow_turns() {
    for (int i = 0; i < links(); ++i) {
      const Real *along = state_.along(i), *z = state_.free(i);
      if (!may_leave(anchors_[i], i, along, turn_)) continue;
      Numbers end = totals(increments(i));
      for (std::size_t k = 0; k < D; ++k) end[k] = along[k] + (columns_.h() * z[k] + end[k]);
      follow_turn(anchors_[i], along, z, i, columns_.h(), Real(1), end);
    }
  }

  Chain<Space, N> chain_;
  ChainLinks<Space, N, Real> constants_;
  detail::StageColumns<S, Real> columns_;
  std::int64_t restoring_interval_;  // steps: Gauss methods keep lengths but for rounding
  RodState<Space, N, Real> state_;
  detail::PerLink<AngleAnchor<Space, Real>, N> anchors_, saved_anchors_{anchors_}, remembered_anchors_{anchors_};
  detail::LinkArray<per_link, N, Real> stages_;
  detail::LinkArray<Space::torque_components * Z, N, Real> torque_;
  double fastest_ = 0;  // bob, squared  [m²/s²]
  bool torque_is_set_ = false, is_predicted_ = false, hangs_ = false;
  double step_ = 0;  // of the stages
  double turn_ = 0;
  double last_h_ = 0;  // of the step that the stages belong to; 0: they belong to none
  std::int64_t steps_ = 0;
};

}  // namespace pendula

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/held_stages.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/chain/rod_state.hpp>
#include <pendula/chain/stage_change.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/gauss/stage_layout.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/numeric/lanes.hpp>
#include <utility>
#include <xsimd/xsimd.hpp>

namespace pendula {

/// State and stages of one chain, for both iterations: the fixed point of ChainMotion, and Newton's. All stages of one
/// number are the lanes of a Lanes<S, Real>.
template <class Space, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainStages : public HeldStages<Space, S, N, RealType> {
  using Base = HeldStages<Space, S, N, RealType>;
  using Base::anchors_, Base::columns_, Base::constants_, Base::direction, Base::entry, Base::kept_, Base::past,
      Base::prediction_, Base::rate_at, Base::rods_, Base::stages_, Base::turn_;

 public:
  using Real = RealType;
  using Base::D, Base::links, Base::Z;
  using typename Base::L, typename Base::Numbers, typename Base::State;
  using Vector = std::array<L, D>;  ///< one vector at all stages

  explicit ChainStages(const Chain<Space, N>& chain, Family family = Family::gauss)
      : Base(chain.links(), family), chain_(chain), restoring_interval_(family == Family::gauss ? 16 : 1) {
    const ChainLinks<Space, N, Real> given(chain);
    Real length(0);
    for (int i = 0; i < links(); ++i) {
      constants_[i] = given[i];
      rods_.set_mass(i, given[i].inverse_mass);
      length += given[i].length;
    }
    this->gravity_ = Real(chain.gravity());
    this->slowest_pace_ = slowest_pace_squared<Real>(Real(links()), this->gravity_, length);
    this->fastest_swing_ = given.fastest_swing_squared();
    if (chain.loaded()) this->expect_loads();
    if (chain.is_held()) this->hold(*chain.end(), family);
  }

  const Chain<Space, N>& chain() const { return chain_; }
  bool loaded() const { return this->has_loads(); }

  // --- Values of one link at all stages ---

  Vector increments(int i) const {
    return components<D>([&](std::size_t k) { return stages_[i].U[k][0]; });
  }
  void set_increments(int i, const Vector& U) {
    is_finished_ = false;
    for (std::size_t k = 0; k < D; ++k) stages_[i].U[k].set(0, U[k]);
  }
  L multiplier(int i) const { return stages_[i].tau[0]; }
  void set_multiplier(int i, const L& tau) {
    is_finished_ = false;
    stages_[i].tau.set(0, tau);
  }

  /// X, a rod at the stages.
  Vector place(int i) const {
    const L hc = columns_.hc(), hc_low = columns_.hc_low();
    return components<D>([&](std::size_t k) {
      const L z(rods_.free(i)[k]);
      const L moved = columns_.integral(stages_[i].U[k].numbers(), fma(hc_low, z, L(rods_.along_low(i)[k])));
      return L(rods_.along(i)[k]) + fma(hc, z, moved);
    });
  }

  /// h b times the sum of τ ξ̇, damping and torque, with the rod at X.
  Vector pull(int i, const Vector& X) const {
    const Vector moved = advance(i), pull = scaled(multiplier(i), moved);
    return this->pulls_more_ ? sum(pull, this->more_pull(i, 0, columns_.hb(), X, moved)) : pull;
  }

  /// h b ξ̇.
  Vector advance(int i) const { return Base::advance(i, 0); }

  /// Σ_j h a_kj f(j) at the stages k, with f all forces on a rod except its multiplier's, and the rod at X.
  Vector impulse_without_multiplier(int i, const Vector& X) const {
    Vector impulse;
    impulse.fill(L(Real(0)));
    if (this->pulls_more_) {
      const Vector pull = this->more_pull(i, 0, columns_.hb(), X, advance(i));
      for (std::size_t k = 0; k < D; ++k) impulse[k] = -columns_.integral(pull[k]);
    }
    impulse[D - 1] = impulse[D - 1] - columns_.hc() * L(constants_[i].weight);
    return impulse;
  }

  /// Tension over length of the rod of a chain at rest, in a step that does not resolve how fast the chain can swing;
  /// 0 in others (ChainForces).
  Real hanging(int i) const { return this->hangs_ * constants_[i].hanging; }

  /// Torque on link i, times h b / l².
  auto torque(int i) const {
    return components<Space::torque_components>([&](std::size_t k) { return this->torques_[i][k][0]; });
  }

  /// Newton keeps these between its sweeps: rods at the stages, and the changes of the bob's velocity up to there.
  void set_kept(int i, const Vector& rod, const Vector& gained) {
    for (std::size_t k = 0; k < D; ++k) {
      stages_[i].rod[k].set(0, rod[k]);
      kept_[i].freed[0][k].set(0, gained[k]);
    }
  }
  Vector kept_rod(int i) const { return this->rod(i, 0); }
  Vector kept_gain(int i) const {
    return components<D>([&](std::size_t k) { return kept_[i].freed[0][k][0]; });
  }

  // --- A step ---

  void start(const State& state) {
    prediction_ = {};
    fastest_ = 0;
    using Wide = typename Base::Rods::Wide;
    for (int i = 0; i < links(); ++i) {
      std::array<Real, Space::dof> q;
      std::array<Wide, Space::dof> angles, rates;
      for (std::size_t a = 0; a < q.size(); ++a) {
        q[a] = state.q[entry(i, a)];
        angles[a] = Wide(q[a]);
        rates[a] = Wide(state.v[entry(i, a)]);
      }
      rods_.start(0, i, Wide(constants_[i].length), Heading<Space, Wide>(angles, rates));
      anchors_[i].set(direction(i), q);
    }
    this->close_end(state.time);
  }

  /// Predicts the stages of a step.
  void prepare(const StepTask& task) {
    if (task.from == PredictedFrom::same_step && !is_finished_) finish();
    const auto [ratio, kind] = prediction_.next(task, S, Base::Columns::most_depth);
    const Real h = static_cast<Real>(task.h);
    const bool is_new = h != columns_.h();
    columns_.prepare(h);
    if (loaded() && (is_new || chain_.driven() || !torque_is_set_)) set_torques(task.time);
    Base::predict(h, static_cast<Real>(ratio),
                  {kind.follows, kind.again, kind.cold, Real(kind.depth), Real(kind.known)});
    this->prepare_end(task.time);
    is_first_ = true;
    is_finished_ = false;
  }

  void start_cold() {
    Base::start_cold(true);
    prediction_.forget();
  }

  /// One fixed-point iteration. Returns its change, relative to the size of the step. Calls visit(i, squared changes of
  /// link i at the stages).
  template <class Visit>
  double iterate(Visit visit) {
    const Real changed = Base::iterate(visit);
    if (std::exchange(is_first_, false)) this->scale_ = std::max(this->scale_, changed);  // from rest
    is_finished_ = false;
    return changed == 0 ? 0 : std::sqrt(static_cast<double>(changed / this->scale_));
  }

  double iterate() {
    return iterate([](int, const L&) {});
  }

  /// Takes the first of these changes in a step.
  void see_first(double change) { prediction_.see_first(change); }

  /// The link that one more fixed-point iteration changes most.
  int worst_link() {
    detail::WorstLink<Real> worst;
    iterate([&](int i, const L& change) {
      worst.see(i, detail::StageChange<S, L>::largest_of(change) * constants_[i].inverse_square);
    });
    return worst.link();
  }

  /// The largest turn of a link in the step  [rad].
  double turn() {
    if (!is_finished_) finish();
    return turn_;
  }

  /// The change of the energy in the step less the work of loads, relative to kinetic energy + Σ M |g| l + work. On the
  /// motion it is the error of the method.
  double energy_defect() {
    if (!is_finished_) finish();
    const Energies start = energies();
    const double brought = this->brought();
    trial_ = rods_.place();
    this->move_on();
    const Energies end = energies();
    rods_.place() = trial_;
    return static_cast<double>(end.total() - start.total() - brought) / scale_of(start, brought);
  }

  /// The largest error, at the start of the step, of bobs' velocities by the polynomials through the stages' rates,
  /// relative to the fastest bob so far.
  [[gnu::noinline]] double defect() {
    Numbers bob{}, missed{}, last{};
    Real furthest(0);
    rods_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      const Numbers at_start = rate_at(i, Real(0), columns_.h());
      for (std::size_t k = 0; k < D; ++k) {
        bob[k] += rate[k];
        missed[k] += at_start[k] - rate[k];
        last[k] += columns_.h() == 0 ? rods_.free(i)[k] : Real(past(i).advance[k].numbers()[S - 1] / columns_.h());
      }
      furthest = std::max(furthest, dot(missed, missed));
      fastest_ = std::max({fastest_, static_cast<double>(dot(bob, bob)), static_cast<double>(dot(last, last))});
    });
    const double fall = std::abs(static_cast<double>(this->gravity_ * constants_[0].length));
    return furthest > 0 ? std::sqrt(static_cast<double>(furthest) / std::max(fastest_, StepShape::slow_squared * fall))
                        : 0;
  }
  /// By which factor the error of the prediction exceeds that defect (StepPrediction::gain).
  double predictor_gain() const {
    return prediction_.gain([&] { return columns_.predictor_gain(); });
  }

  Tempo tempo() const {
    Real pace, quickening;
    Base::tempo(pace, quickening);
    return {static_cast<double>(pace), static_cast<double>(quickening)};
  }

  /// The shape of the solved step, which shows its error.
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
    if (loaded()) shape.beyond = missed_at_start();
    return shape;
  }

  /// The work of loads in the step  [J].
  double brought() {
    return (loaded() ? static_cast<double>(Base::work()) : 0) + static_cast<double>(this->brought_by_end());
  }

  /// Moves the state to the end of the step.
  void accept() {
    if (!is_finished_) finish();
    Base::follow_turns();
    this->move_on();
    this->note_end();
    prediction_.accept();
    if (prediction_.steps() % restoring_interval_ == 0) {
      rods_.restore_lengths(constants_, Everyone{});
      this->return_end();
    }
    for (int i = 0; i < links(); ++i) anchors_[i].follow(direction(i));
  }

  template <class MemberNumbers>
  void member(MemberNumbers& numbers) {
    numbers(rods_, prediction_, fastest_, this->newest_, this->hangs_, this->scale_);
    if (this->is_held()) Base::member(numbers);
    for (int i = 0; i < links(); ++i) {
      numbers(anchors_[i]);
      for (auto& step : this->pasts_[i]) {
        for (auto& row : step.advance) numbers.range(row.numbers(), S);
        numbers.range(step.tau.numbers(), S);
      }
    }
  }

 private:
  void finish() {
    Base::finish();
    is_finished_ = true;
    turn_ = std::sqrt(static_cast<double>(this->turn_squared()));
  }

  StepShape shape_of(const L& quartic, const L& decay) const {
    alignas(pack_alignment) Real paces[Z], squares[Z];
    quartic.store(paces);
    decay.store(squares);
    StepShape shape;
    for (std::size_t k = 0; k < S; ++k) shape.decay[k] = std::sqrt(static_cast<double>(squares[k]));
    shape.pace =
        std::sqrt(static_cast<double>(this->slowest_pace_) + std::pow(static_cast<double>(paces[S / 2]), 0.25));
    return shape;
  }

  // The largest error, at the start of the step, of the polynomials through the stages' rates, times h, relative to the
  // length of the rod.
  double missed_at_start() const {
    Real furthest(0);
    rods_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      const Numbers missed = components<D>([&](std::size_t k) {
        return Real(rods_.free(i)[k] + columns_.at_start(stages_[i].U[k].numbers()) - rate[k]);
      });
      furthest = std::max(furthest, Real(dot(missed, missed) * constants_[i].inverse_square));
    });
    return std::abs(prediction_.h()) * std::sqrt(static_cast<double>(furthest));
  }

  void set_torques(double time) {
    using std::sin;
    for (int i = 0; i < links(); ++i) {
      const L scale = columns_.hb() * L(constants_[i].inverse_square);
      for (std::size_t k = 0; k < Space::torque_components; ++k) {
        this->torques_[i][k].set(0, scale * L(Real(chain_.constant_torque()(static_cast<Eigen::Index>(k), i))));
      }
    }
    for (const Drive<Space>& drive : chain_.drives()) {
      for (std::size_t j = 0; j < S; ++j) {
        const Real at = Real(time) + columns_.h() * columns_.c(j);
        const Real wave = sin(Real(drive.frequency) * at + Real(drive.phase)) * columns_.hb(j) *
                          constants_[drive.link].inverse_square;
        for (std::size_t k = 0; k < Space::torque_components; ++k) {
          this->torques_[drive.link][k].numbers()[j] += wave * Real(drive.amplitude[static_cast<Eigen::Index>(k)]);
        }
      }
    }
    torque_is_set_ = true;
  }

  struct Energies {
    Real kinetic{0}, potential{0};
    Real total() const { return kinetic + potential; }
  };

  Energies energies() const {
    Energies energy;
    Numbers bob{};
    rods_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      bob = sum(bob, rate);
      energy.kinetic += constants_[i].mass * dot(bob, bob) / 2;
      energy.potential += constants_[i].weight * rods_.along(i)[D - 1];
    });
    return energy;
  }

  double scale_of(const Energies& start, double brought) const {
    const double scale = static_cast<double>(start.kinetic) + energy_scale(chain_) + std::abs(brought);
    return scale > 0 ? scale : 1;
  }

  Chain<Space, N> chain_;
  std::int64_t
      restoring_interval_;  // steps after which lengths are restored: Gauss methods conserve them, except for rounding
  typename Base::Rods::FullState trial_{links()};
  double fastest_ = 0;  // squared velocity of the fastest bob so far  [m²/s²]
  bool torque_is_set_ = false, is_finished_ = false, is_first_ = true;
};

}  // namespace pendula

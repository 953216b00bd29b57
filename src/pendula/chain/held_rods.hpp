#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/end_mobility.hpp>
#include <pendula/numeric/compensated.hpp>

namespace pendula {

/// The rods of a chain (RodState) and its last bob, where that is held. `constants[i]`: LinkConstants.
template <class Rods>
class HeldRods {
  static constexpr std::size_t D = Rods::D;

 public:
  using Number = typename Rods::C;
  using Vector = typename Rods::Vector;

  /// How the last bob moves by multipliers that follow from right(i) (multipliers.hpp), and gives way to a push.
  struct Tip {
    detail::EndMobility<Number, D> mobility;
    Vector moved;
  };
  template <class Constants, class Right>
  static Tip find_tip(const Rods& rods, const Constants& constants, Right right) {
    Vector rod = rods.rod(0);
    Number inverse = Number(1.0) / (constants[0].inverse_masses * dot(rod, rod)), found = right(0);
    for (int i = 1; i < rods.links(); ++i) {
      const Vector next = rods.rod(i);
      const Number beyond = -constants[i - 1].inverse_mass.value * dot(rod, next), coupling = beyond * inverse;
      inverse = Number(1.0) / (constants[i].inverse_masses * dot(next, next) - beyond * coupling);
      found = right(i) - coupling * found;
      rod = next;
    }
    const Number share = inverse * constants[rods.links() - 1].inverse_mass.value;
    return {{rod, share}, scaled(Number(share * found), rod)};
  }

  /// Calls visit(i, ξ̇_i, ξ̈_i) for all rods, where the last bob accelerates as `wanted`, and what acts besides
  /// multipliers accelerates rod i by fallen(i). Returns the acceleration of the last bob by the force that holds it.
  template <class Constants, class Fallen, class Visit>
  static Vector accelerations(const Rods& rods, const Constants& constants, Fallen fallen, const Vector& wanted,
                              Visit visit) {
    const int last = rods.links() - 1;
    rods.for_each_rate(constants, [&](int i, const Vector& rate, const Number&) { rods.rate_room(i) = rate; });
    const auto right = [&](int i) {
      const Vector& rate = rods.rate_room(i);
      return Number(-(dot(rate, rate) + dot(rods.rod(i), fallen(i))));
    };
    const Tip tip = find_tip(rods, constants, right);
    Vector lacking = difference(wanted, tip.moved);
    for (int i = 0; i <= last; ++i) lacking = difference(lacking, fallen(i));
    const Vector push = tip.mobility.inverse(lacking);
    rods.eliminate(constants, [&](int i) { return i < last ? right(i) : right(i) - dot(tip.mobility.rod, push); });
    rods.for_each_bond(constants, [&](int i, const Vector& change, const Number&) {
      const Vector all = sum(change, fallen(i));
      visit(i, rods.rate_room(i), i < last ? all : sum(all, push));
    });
    return push;
  }

  /// Where the last bob is beside a place, with the low parts.
  static Vector gap(const Rods& rods, const Vector& place) {
    return sum_of(rods.place().along, rods.place().along_low, scaled(Number(-1.0), place), rods.links());
  }

  /// What the free rates of all rods sum up to, their low parts apart.
  struct Sums {
    Vector high, low;
  };
  static Sums sum_of_free(const Rods& rods) {
    Sums sums{};
    Vector lost{};
    for (int i = 0; i < rods.links(); ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        const Twofold<Number> next = exact_sum(sums.high[k], rods.free(i)[k]);
        sums.high[k] = next.value;
        lost[k] += next.low;
        sums.low[k] += rods.free_low(i)[k];
      }
    }
    sums.high = sum(sums.high, lost);
    return sums;
  }

  /// Adds to the free rate of the last rod.
  static void push(Rods& rods, const Vector& by) {
    auto& place = rods.place();
    const int last = rods.links() - 1;
    for (std::size_t k = 0; k < D; ++k) add(place.free[last][k], place.free_low[last][k], by[k]);
  }

  /// Gives the last bob this rate, by the impulse that it takes: the push, and what is left over of the rate.
  struct Pushed {
    Vector push, left;
  };
  template <class Constants>
  static Pushed push_to_rate(Rods& rods, const Constants& constants, const Vector& rate) {
    const Tip tip = find_tip(rods, constants, [&](int i) { return Number(-rods.exact_product_of(i)); });
    const auto& place = rods.place();
    const Vector off = sum_of(place.free, place.free_low, scaled(Number(-1.0), rate), rods.links());
    const Vector lacking = scaled(Number(-1.0), sum(tip.moved, off)), found = tip.mobility.inverse(lacking);
    push(rods, found);
    return {found, difference(lacking, tip.mobility(found))};
  }

  /// Moves the last bob by a small way, and the others with it.
  template <class Constants>
  static void move_end(Rods& rods, const Constants& constants, const Vector& by) {
    const Tip tip = find_tip(rods, constants, [](int) { return Number(0.0); });
    const Vector push = tip.mobility.inverse(by);
    const int last = rods.links() - 1;
    rods.eliminate(constants, [&](int i) { return i < last ? Number(0.0) : Number(-dot(tip.mobility.rod, push)); });
    rods.for_each_bond(constants, [&](int i, const Vector& change, const Number&) {
      const Vector all = i < last ? change : sum(change, push);
      for (std::size_t k = 0; k < D; ++k) add(rods.place().along[i][k], rods.place().along_low[i][k], all[k]);
    });
    rods.restore_lengths(constants, true);
  }

 private:
  static void add(Number& value, Number& low, const Number& by) {
    const Twofold<Number> wanted = exact_sum(by, low), sum = exact_sum(value, wanted.value);
    value = sum.value;
    low = sum.low + wanted.low;
  }

  // start + all of these vectors, with their low parts.
  template <class Numbers>
  static Vector sum_of(const Numbers& high, const Numbers& low, const Vector& start, int links) {
    Vector sum = start, lost{};
    for (int i = 0; i < links; ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        const Twofold<Number> next = exact_sum(sum[k], high[i][k]);
        sum[k] = next.value;
        lost[k] += next.low + low[i][k];
      }
    }
    return pendula::sum(sum, lost);
  }
};

}  // namespace pendula

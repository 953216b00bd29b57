#include <cmath>
#include <functional>
#include <pendula/chain/chain_links.hpp>
#include <pendula/ensemble/lane_kind.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/system_subject.hpp>

namespace pendula {

namespace {

template <class Kind>
bool has_lanes(const RunOptions& options, bool with_tangents) {
  const LaneMovers<Kind> lanes = library<LaneMovers<Kind>>();
  return (with_tangents ? lanes.with_tangents : lanes.plain)(options) != nullptr;
}

// Names the chain or kernel in `kind`; false if there are no lanes for it.
template <class Space>
bool name_chain(const RunSetup& setup, const RunOptions& options, bool with_tangents, LaneKind& kind) {
  const auto* const chain = dynamic_cast<const ChainSubject<Space>*>(setup.subject.get());
  if (chain == nullptr || chain->chain().is_held() || !has_lanes<Space>(options, with_tangents)) return false;
  kind.dimension = Space::dimension;
  kind.links = chain->chain().links();
  if (options.method == Method::taylor) {
    const bool is_loaded = setup.subject->loaded();
    if (!with_tangents) kind.kernel = series_kernel<Space>(kind.links, is_loaded, true);
    return kind.kernel != nullptr || !is_loaded;
  }
  if (!is_explicit(options.method)) {
    if (options.solver == Solver::dense) return false;
    // With constant steps that do not resolve a chain, fixed points hardly converge. Adaptive steps become shorter
    // instead.
    if (!is_adaptive(options) && !ChainLinks<Space>(chain->chain()).resolves(options.step)) return false;
  }
  return true;
}
bool name_kernel(const RunSetup& setup, const RunOptions& options, bool with_tangents, LaneKind& kind) {
  const auto* const system = dynamic_cast<const SystemSubject*>(setup.subject.get());
  if (system == nullptr || !has_lanes<Models>(options, with_tangents)) return false;
  if (!system->info().constraints.empty()) return false;
  const bool by_series = options.method == Method::taylor;
  if (by_series && system->table().of_1.series_next == nullptr) return false;
  if (!is_explicit(options.method) && system->info().depends_on_time) return false;
  if (!system->switches().empty()) return false;  // each member would end its steps at its own switchings
  if (system->may_be_narrow()) return false;      // steps in lanes do not check forces between their stages
  kind.kernel = &system->table();
  return true;
}

}  // namespace

bool detail::has_to_be_tried(const Subject& subject) {
  return subject.loaded() || dynamic_cast<const SystemSubject*>(&subject) != nullptr;
}

namespace {

std::optional<LaneKind> kind_of(const RunSetup& setup, const RunOptions& options, bool with_tangents) {
  const double chosen = is_adaptive(options) ? options.tolerance : options.step;
  const bool by_fixed_point = options.form == Form::momentum && options.iteration != Iteration::newton;
  const bool fits = (by_fixed_point || is_explicit(options.method)) && chosen > 0 && std::isfinite(chosen) &&
                    setup.every >= 1 && setup.duration > 0 && std::isfinite(setup.duration) && !setup.rows.any() &&
                    setup.accuracy.error == 0;
  LaneKind kind;
  if (!fits ||
      !(name_chain<Planar>(setup, options, with_tangents, kind) ||
        name_chain<Spatial>(setup, options, with_tangents, kind) || name_kernel(setup, options, with_tangents, kind))) {
    return {};
  }
  if (options.method == Method::gauss) kind.stages = options.stages;
  kind.method = options.method;
  kind.iteration = options.iteration;
  (is_adaptive(options) ? kind.tolerance : kind.step) = chosen;
  kind.every = setup.every;
  return kind;
}

}  // namespace

std::optional<LaneKind> lane_kind(const RunSetup& setup, const RunOptions& options) {
  return kind_of(setup, options, false);
}
std::optional<LaneKind> lane_kind(const RunSetup& setup) {
  return lane_kind(setup, setup.options);
}
std::optional<LaneKind> tangent_lane_kind(const RunSetup& setup, const RunOptions& options) {
  return kind_of(setup, options, true);
}

}  // namespace pendula

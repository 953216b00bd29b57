// Programs of interpreted models: any text is a model that can be evaluated and moved, or is refused.
#include <pendula/pendula.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

void require_known(const char* what) {
  if (pendula_error_kind() != PENDULA_INTERNAL) return;
  std::fprintf(stderr, "%s: %s\n", what, pendula_error());
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  pendula_model* model = pendula_model_of_program(text.c_str(), nullptr, 0);
  require_known("reading");
  if (model == nullptr) return 0;
  const std::size_t n = pendula_coordinates(model);
  const std::vector<double> q(n, 0.3), v(n, -0.1);
  std::vector<double> row(pendula_columns(model)), field(2 * n), energies(2);
  pendula_row(model, 0, q.data(), v.data(), nullptr, row.data());
  pendula_energies(model, 0, q.data(), v.data(), energies.data());
  pendula_field(model, 0, q.data(), v.data(), nullptr, field.data());
  require_known("evaluating");
  for (const char* method : {"gauss", "taylor"}) {
    int asked = 0;
    pendula_options options{};
    options.method = method;
    options.tolerance = 1e-3;
    pendula_simulation* run = pendula_simulation_new(model, 0, q.data(), v.data(), &options);
    if (run != nullptr) {
      pendula_heed(
          run, [](void* context) { return ++*static_cast<int*>(context) > 100 ? 1 : 0; }, &asked);
      pendula_advance_to(run, 0.1);
      std::vector<double> a(4 * n * n), b(2 * n * pendula_inputs(model));
      pendula_linearize(run, a.data(), b.data());
      pendula_simulation_free(run);
    }
    require_known(method);
  }
  pendula_model_free(model);
  return 0;
}

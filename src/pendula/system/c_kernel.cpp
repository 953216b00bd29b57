#include <pendula/system/c_kernel.hpp>
#include <pendula/system/kernel_text.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {
namespace {

struct DescribedTable {
  std::shared_ptr<const void> object;
  KernelDescription description;
  SystemTable table;
};

}  // namespace

std::shared_ptr<const SystemTable> table_of(const CKernel& kernel, std::shared_ptr<const void> object) {
  if (kernel.interface != system_interface) {
    throw std::invalid_argument("expected a kernel of the interface " + std::to_string(system_interface) + ", got " +
                                std::to_string(kernel.interface));
  }
  const auto kept = std::make_shared<DescribedTable>();
  kept->object = std::move(object);
  KernelText text(kernel.description);
  while (text.next()) {
    if (!kept->description.take(text)) text.fail("a line of a kernel's description", text.kind());
  }
  const auto& [of_1, of_2, of_4, of_8] = kernel.functions;
  kept->table = {kept->description.info(), nullptr, *of_1, *of_2, *of_4, *of_8, *kernel.plain};
  return {kept, &kept->table};
}

}  // namespace pendula

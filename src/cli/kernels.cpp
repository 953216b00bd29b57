#include <iomanip>
#include <iostream>
#include <pendula/run/integrator.hpp>
#include <pendula/run/library.hpp>

#include "cli/commands.hpp"

namespace pendula::cli {

ExitStatus kernels() {
  std::cout << std::left << std::setw(14) << "kernel" << std::setw(9) << "space"
            << "links\n";
  for (const KernelInfo& kernel : built_in_kernels()) {
    std::cout << std::setw(14) << kernel.name << std::setw(9) << kernel.space << kernel.links << '\n';
  }
  for (const SystemTable* table : library<KernelList<Models>>().tables) {
    std::cout << std::setw(14) << table->info.name << std::setw(9) << "-" << table->info.links << '\n';
  }
  return done;
}

}  // namespace pendula::cli

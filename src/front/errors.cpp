#include "front/errors.hpp"

#include <cstddef>
#include <cstring>
#include <exception>
#include <new>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/run_failed.hpp>

#include "io/errors.hpp"

namespace pendula::front {
namespace {

constexpr std::size_t longest = 1024;
constinit thread_local char text[longest] = "";
constinit thread_local pendula_status kind = PENDULA_OK;

}  // namespace

pendula_status fail(pendula_status status, const char* what) noexcept {
  std::strncpy(text, what, longest - 1);
  return kind = status;
}

pendula_status fail() noexcept {
  try {
    throw;
  } catch (const RunFailed& error) {
    return fail(PENDULA_FAILED, error.what());
  } catch (const NoKernel& error) {
    return fail(PENDULA_NO_KERNEL, error.what());
  } catch (const io::InputError& error) {
    return fail(PENDULA_NOT_WRITTEN, error.what());
  } catch (const io::OutputError& error) {
    return fail(PENDULA_NOT_WRITTEN, error.what());
  } catch (const std::invalid_argument& error) {
    return fail(PENDULA_INVALID, error.what());
  } catch (const std::exception& error) {
    return fail(PENDULA_INTERNAL, error.what());
  } catch (...) {
    return fail(PENDULA_INTERNAL, "something was thrown that is no exception");
  }
}

}  // namespace pendula::front

extern "C" {

const char* pendula_error(void) {
  return pendula::front::text;
}

pendula_status pendula_error_kind(void) {
  return pendula::front::kind;
}
}

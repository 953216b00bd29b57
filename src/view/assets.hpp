#pragma once

#include <string_view>

/// The files of src/view/page, as the build found them: made by cmake/embed.cmake.
namespace pendula::view::assets {

extern const std::string_view page;           ///< page.html, with {{names}} of what comes in
extern const std::string_view style;          ///< page.css
extern const std::string_view script_before;  ///< what any page needs, as one module with the two that follow
extern const std::string_view script_plane;   ///< what draws points in the plane,
extern const std::string_view script_space;   ///< points in space,
extern const std::string_view script_lanes;   ///< and coordinates without points
extern const std::string_view script_after;

extern const std::string_view lab_page;  ///< by cmake/lab_page.cmake, with {{title}} and {{start}}

}  // namespace pendula::view::assets

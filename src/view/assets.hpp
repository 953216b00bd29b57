#pragma once

#include <string_view>

/// The files of src/view/page at build time; cmake/embed.cmake makes the definitions.
namespace pendula::view::assets {

extern const std::string_view page;           ///< page.html, with {{names}} of parts to fill in
extern const std::string_view style;          ///< page.css
extern const std::string_view script_before;  ///< the part that any page needs, one module with one of the following
extern const std::string_view script_plane;   ///< draws points in the plane
extern const std::string_view script_space;   ///< draws points in space
extern const std::string_view script_lanes;   ///< draws coordinates without points
extern const std::string_view script_after;

extern const std::string_view lab_page;  ///< by cmake/lab_page.cmake, with {{title}} and {{start}}

}  // namespace pendula::view::assets

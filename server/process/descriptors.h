#pragma once

namespace taclink::server {

/// This process may open as many files as the system lets it: the soft limit (often 1,024, for programs that
/// use select) becomes the hard one. Before connections are taken.
void RaiseDescriptorLimit();

}  // namespace taclink::server

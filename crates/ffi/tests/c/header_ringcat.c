/* Each function of the header; it is the only include. */
#include "ringcat.h"

int use(ec_master_t *master, ec_domain_t *domain, ringcat_variable_t *variable);

int use(ec_master_t *master, ec_domain_t *domain, ringcat_variable_t *variable)
{
    uint64_t again_at;
    const int loaded = ringcat_master_load_network(master, "machine.toml");

    const int others = ringcat_master_load_network_data(master, "", 0) || ringcat_master_load_eni(master, "machine.xml")
        || ringcat_master_load_eni_data(master, "", 0);

    const int again = ringcat_domain_send_again(domain, 1) || ringcat_master_receive_again_at(master, &again_at);

    return loaded || others || again || !ringcat_master_subdevice(master, "Drive")
        || !ringcat_master_domain(master, "cycle")
        || ringcat_master_variable(master, "Drive.Feedback.Statusword", variable);
}
